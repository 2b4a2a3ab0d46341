// Adds in the same order as NumPy, so that sums agree with NumPy's in the last bit.
#pragma once

#include <array>
#include <cstddef>

namespace dbr::bullet {

// Returns the sum of value(0) to value(count - 1). Requires count <= 128, because NumPy splits longer sums.
// Fewer than 8 values are added one by one. Else there are eight running sums, and the last values that do
// not fill another eight are added one by one. O(count).
template <typename T, typename Value>
T NumpySum(std::size_t count, Value value) {
  constexpr std::size_t kWays = 8;
  if (count < kWays) {
    T sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += value(i);
    return sum;
  }
  std::array<T, kWays> ways;
  std::size_t i = 0;
  for (; i < kWays; ++i) ways[i] = value(i);
  for (; i + kWays <= count; i += kWays) {
    for (std::size_t way = 0; way < kWays; ++way) ways[way] += value(i + way);
  }
  T sum = ((ways[0] + ways[1]) + (ways[2] + ways[3])) + ((ways[4] + ways[5]) + (ways[6] + ways[7]));
  for (; i < count; ++i) sum += value(i);
  return sum;
}

template <typename T, typename Value>
T NumpyMean(std::size_t count, Value value) {
  return NumpySum<T>(count, value) / static_cast<T>(count);
}

}  // namespace dbr::bullet
