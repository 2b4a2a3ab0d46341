// The 16-bit floating-point type of products in reduced precision: the upper half of a float32, with 8 bits
// of mantissa.
#pragma once

#include <Eigen/Core>
#include <type_traits>

namespace dbr {

using Bfloat16 = Eigen::bfloat16;

// The type in which products of Elements are summed, and in which a network has its bias, its output and its
// gradient: float for Bfloat16, else Element itself.
template <class Element>
using SumOf = std::conditional_t<std::is_same_v<Element, Bfloat16>, float, Element>;

// A count of rows rounded up to what the products of Elements like: processors multiply Bfloat16 in groups of
// 32 along the dimension that is summed over. Rows that are added are 0.
template <class Element>
constexpr Eigen::Index PaddedRows(Eigen::Index rows) {
  constexpr Eigen::Index kGroup = std::is_same_v<Element, Bfloat16> ? 32 : 1;
  return (rows + kGroup - 1) / kGroup * kGroup;
}

// Rounds n values to the nearest Bfloat16, a tie to the even one, as processors do. A NaN stays one.
void RoundToBfloat16(const float* values, Eigen::Index n, Bfloat16* rounded);

}  // namespace dbr
