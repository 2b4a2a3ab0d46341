// The asymmetric squared error that fits an expectile.
#pragma once

#include <cmath>

#include "core/batch.h"

namespace dbr {

// Returns the mean of |expectile - 1(u < 0)| u^2 with u = q - v (Kostrikov, Nair, Levine 2021, equation 5).
// Sets `d_v` [1 x n] to its gradient with respect to v [1 x n]. q [n] is a constant.
template <class Scalar>
Scalar ExpectileError(const MatrixX<Scalar>& v, const VectorX<Scalar>& q, double expectile,
                      MatrixX<Scalar>* d_v) {
  const auto above = static_cast<Scalar>(expectile), below = static_cast<Scalar>(1 - expectile);
  const auto n = static_cast<Scalar>(q.size());
  d_v->resize(1, q.size());
  Scalar sum = 0;
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const Scalar u = q[j] - v(0, j), weight = u < 0 ? below : above;
    sum += weight * u * u;
    (*d_v)(0, j) = -2 * weight * u / n;
  }
  return sum / n;
}

}  // namespace dbr
