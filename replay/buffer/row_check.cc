#include "replay/buffer/row_check.h"

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "absl/types/span.h"

namespace dbr {
namespace {

// Looks at the exponent's bits, so that the compiler vectorizes the loop.
bool AllFinite(absl::Span<const float> values) {
  constexpr std::uint32_t kExponent = 0x7f800000u;
  std::uint32_t bad = 0;
  for (const float value : values) bad |= (std::bit_cast<std::uint32_t>(value) & kExponent) == kExponent;
  return bad == 0;
}

bool IsAction(float action, int actions) {
  return action >= 0 && action < static_cast<float>(actions) && action == std::floor(action);
}

bool RowIsGood(const TransitionLayout& layout, const InsertColumns& columns, int i) {
  const TransitionView row = columns.Row(layout, i);
  bool good = !std::isinf(columns.Advantage(i)) &&
              (layout.mask_width == 0 || IsAction(row.action[0], layout.mask_width));
  ForEachColumn([&good](const ColumnPlace& place,
                        const auto* value) { good = good && AllFinite(FloatsOf(*value, place.width)); },
                layout.columns(), ValuesOf(row));
  return good;
}

bool AllGood(const TransitionLayout& layout, const InsertColumns& c) {
  const std::size_t n = static_cast<std::size_t>(c.count);
  bool finite = true;
  ForEachColumn(
      [&finite, n](const ColumnPlace& place, const float* column) {
        finite = finite && AllFinite({column, n * static_cast<std::size_t>(place.width)});
      },
      layout.columns(), c);
  if (!finite) return false;
  for (int i = 0; i < c.count; ++i) {
    if (std::isinf(c.Advantage(i))) return false;
    if (layout.mask_width > 0 &&
        !IsAction(c.actions[static_cast<std::size_t>(i) * layout.action_width], layout.mask_width))
      return false;
  }
  return true;
}

}  // namespace

std::vector<bool> RefusedRows(const TransitionLayout& layout, const InsertColumns& columns) {
  if (AllGood(layout, columns)) return {};
  std::vector<bool> refused(static_cast<std::size_t>(columns.count));
  for (int i = 0; i < columns.count; ++i)
    refused[static_cast<std::size_t>(i)] = !RowIsGood(layout, columns, i);
  return refused;
}

}  // namespace dbr
