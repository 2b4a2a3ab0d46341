#include "replay/buffer/row_check.h"

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "absl/types/span.h"

namespace dbr {
namespace {

// By the exponent's bits, so that the loop is vectorized.
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
  return AllFinite(row.observation) && AllFinite(row.action) && AllFinite(row.mask) &&
         AllFinite({&row.reward, 1}) && AllFinite({&row.discount, 1}) &&
         (layout.return_width == 0 || AllFinite({&row.monte_carlo_return, 1})) &&
         AllFinite(row.next_observation) && AllFinite(row.next_mask) && !std::isinf(columns.Advantage(i)) &&
         (layout.mask_width == 0 || IsAction(row.action[0], layout.mask_width));
}

bool AllGood(const TransitionLayout& layout, const InsertColumns& c) {
  const std::size_t n = static_cast<std::size_t>(c.count);
  if (!AllFinite({c.observations, n * layout.observation_width}) ||
      !AllFinite({c.actions, n * layout.action_width}) || !AllFinite({c.masks, n * layout.mask_width}) ||
      !AllFinite({c.rewards, n}) || !AllFinite({c.discounts, n}) ||
      !AllFinite({c.returns, n * layout.return_width}) ||
      !AllFinite({c.next_observations, n * layout.observation_width}) ||
      !AllFinite({c.next_masks, n * layout.mask_width})) {
    return false;
  }
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
