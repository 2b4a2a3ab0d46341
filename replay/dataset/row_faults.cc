#include "replay/dataset/row_faults.h"

#include <algorithm>
#include <cstring>

namespace dbr {
namespace {

constexpr std::uint32_t kInfinityBits = 0x7f800000;
// Actions that were scaled to [-1, 1] in float32 may lie as far beside it.
constexpr float kGreatestAction = 1.0f + 1e-5f;

// The bits of a float without its sign. They rise with its size, infinities and NaN last, so that one maximum
// over many values tells whether any of them is too large.
std::uint32_t Magnitude(float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits & 0x7fffffffu;
}

bool AllBelow(absl::Span<const float> values, std::uint32_t limit) {
  std::uint32_t greatest = 0;
  for (const float value : values) greatest = std::max(greatest, Magnitude(value));
  return greatest < limit;
}

}  // namespace

void MarkNotFinite(absl::Span<const float> values, int width, std::vector<std::uint8_t>* marks) {
  if (AllBelow(values, kInfinityBits)) return;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (Magnitude(values[i]) >= kInfinityBits) (*marks)[i / static_cast<std::size_t>(width)] |= kNotFinite;
  }
}

void MarkBadFlags(absl::Span<std::uint8_t> flags, std::uint8_t* marks) {
  for (std::size_t i = 0; i < flags.size(); ++i) {
    if (flags[i] <= 1) continue;
    flags[i] = 0;
    marks[i] |= kBadFlag;
  }
}

std::int64_t CountOutside(absl::Span<const float> actions, int width, const std::uint8_t* marks) {
  const std::uint32_t limit = Magnitude(kGreatestAction) + 1;
  if (AllBelow(actions, limit)) return 0;
  std::int64_t rows = 0;
  const auto columns = static_cast<std::size_t>(width);
  for (std::size_t row = 0; row < actions.size() / columns; ++row)
    rows += marks[row] == 0 && !AllBelow(actions.subspan(row * columns, columns), limit);
  return rows;
}

void CountMarks(absl::Span<const std::uint8_t> marks, std::int64_t first, RowFaults* faults) {
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (marks[i] == 0) continue;
    if (faults->bad++ == 0) faults->first_bad = first + static_cast<std::int64_t>(i);
    faults->bad_flags += (marks[i] & kBadFlag) != 0;
  }
}

}  // namespace dbr
