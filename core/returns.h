// Monte-Carlo returns of an episode's transitions, in flat rows. Free functions without state.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "absl/types/span.h"
#include "core/check.h"
#include "core/transition.h"

namespace dbr {

// Writes the return of each of `rows` [T x stride], an unbroken stretch of one episode in its order:
// R_t = r_t + discount_t * R_{t+1}, with R_T = `value_behind`, the value of the state behind the last row.
// Behind a true terminal it does not count, for the discount is 0. Sums in double. O(T).
inline void FillReturns(const TransitionLayout& layout, double value_behind, absl::Span<float> rows) {
  const std::size_t stride = static_cast<std::size_t>(layout.stride());
  DBR_CHECK(layout.return_width == 1 && rows.size() % stride == 0);
  double value = value_behind;
  for (std::size_t end = rows.size(); end > 0; end -= stride) {
    float* const row = rows.data() + end - stride;
    const double discount = row[layout.discount_offset()];
    value = row[layout.reward_offset()] + (discount == 0 ? 0.0 : discount * value);
    row[layout.return_offset()] = static_cast<float>(value);
  }
}

// Estimates the value behind a stretch `rows` [T x stride] that was cut, where there is no critic to ask: the
// rewards of its end go on for ever. It is the mean reward of the last min(T, 1 / (1 - discount)) rows,
// divided by 1 - discount. Requires 0 <= discount < 1 and T >= 1.
inline double StationaryContinuation(const TransitionLayout& layout, double discount,
                                     absl::Span<const float> rows) {
  DBR_CHECK(discount >= 0 && discount < 1 && !rows.empty());
  const std::size_t stride = static_cast<std::size_t>(layout.stride());
  const auto horizon = static_cast<std::size_t>(std::lround(std::min(1e9, 1 / (1 - discount))));
  const std::size_t count = std::min(rows.size() / stride, horizon);
  double sum = 0;
  for (std::size_t i = 1; i <= count; ++i) sum += rows[rows.size() - i * stride + layout.reward_offset()];
  return sum / static_cast<double>(count) / (1 - discount);
}

}  // namespace dbr
