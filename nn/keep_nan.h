// The smaller and the greater of two values, where a NaN must not get lost.
#pragma once

#include <cmath>

#include "core/batch.h"

namespace dbr {

// std::min, Eigen's cwiseMin and a comparison with ?: give the finite side where the other one is a NaN, on
// one side or on both. A critic that has diverged would then look sound in the figures of an update, which
// are what is checked (learner/training/update_metrics.h). All that chooses between the values of two
// networks goes through these functions. Clipping to a constant keeps a NaN as long as the value stands on
// the left: x.cwiseMax(constant), std::max(x, constant), std::clamp(x, low, high).

// min(a, b), and NaN where a or b is one.
template <class Scalar>
Scalar SmallerOrNan(Scalar a, Scalar b) {
  return b < a || std::isnan(b) ? b : a;
}

// max(a, b), and NaN where a or b is one.
template <class Scalar>
Scalar GreaterOrNan(Scalar a, Scalar b) {
  return b > a || std::isnan(b) ? b : a;
}

// SmallerOrNan of each entry, as an expression: `a` and `b` must outlive its use.
template <class A, class B>
auto EachSmallerOrNan(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  using Scalar = typename A::Scalar;
  return a.derived().binaryExpr(b.derived(), [](Scalar x, Scalar y) { return SmallerOrNan(x, y); });
}

}  // namespace dbr
