// Diagonal Gaussians, one for each column, and gradients with respect to their parameters.
#pragma once

#include "core/batch.h"
#include "nn/mlp.h"

namespace dbr {

// The parameters of n Gaussians, in memory that somebody else owns (two halves of a network's output, for
// example).
template <class Scalar>
struct GaussianView {
  ConstMatrixRef<Scalar> mean;     // [dimensions x n]
  ConstMatrixRef<Scalar> log_std;  // [dimensions x n], clipped already
};

// The gradient of a loss with respect to the parameters of n Gaussians.
template <class Scalar>
struct GaussianGradient {
  MatrixX<Scalar> mean;     // [dimensions x n]
  MatrixX<Scalar> log_std;  // [dimensions x n]

  void Resize(Eigen::Index dimensions, Eigen::Index n) {
    mean.resize(dimensions, n);
    log_std.resize(dimensions, n);
  }
};

}  // namespace dbr
