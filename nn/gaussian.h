// Diagonal Gaussians, one for each column, and gradients with respect to their parameters.
#pragma once

#include "core/batch.h"
#include "nn/mlp.h"

namespace dbr {

// Parameters in memory of somebody else's (two halves of a network's output, for example).
template <class Scalar>
struct GaussianView {
  ConstMatrixRef<Scalar> mean;     // [dimensions x n]
  ConstMatrixRef<Scalar> log_std;  // [dimensions x n], clipped already
};

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
