// The output layer of a Gaussian network: its upper half the means, its lower half the log-stds, clipped.
#pragma once

#include "nn/gaussian.h"

namespace dbr {

// Limits of the log-std (docs/algorithms.md, "Common to all").
struct LogStdLimits {
  double min = -20;
  double max = 2;
};
inline constexpr LogStdLimits kPolicyLogStd{-20, 2};
inline constexpr LogStdLimits kBehaviorLogStd{-5, 2};

// The Gaussians of one batch as a network gave them. A plain value, reused from batch to batch; one thread at
// a time.
template <class Scalar>
class GaussianHead {
 public:
  // Copies means and clipped log-stds out of a network's output [2 * dimensions x n].
  void Split(const ConstMatrixRef<Scalar>& output, const LogStdLimits& limits) {
    const Eigen::Index dimensions = output.rows() / 2;
    const auto min = static_cast<Scalar>(limits.min), max = static_cast<Scalar>(limits.max);
    mean_ = output.topRows(dimensions);
    log_std_ = output.bottomRows(dimensions).cwiseMax(min).cwiseMin(max);
    outside_ = (output.bottomRows(dimensions).array() > max).template cast<Scalar>() -
               (output.bottomRows(dimensions).array() < min).template cast<Scalar>();
  }

  GaussianView<Scalar> view() const { return {mean_, log_std_}; }
  const MatrixX<Scalar>& mean() const { return mean_; }
  const MatrixX<Scalar>& log_std() const { return log_std_; }

  // Turns a gradient with respect to the Gaussians into one with respect to the network's output
  // [2 * dimensions x n]. A log-std that was clipped passes a gradient on only where a step against it leads
  // back towards the limits. Without that, a log-std that has left them could never come back.
  void Join(const GaussianGradient<Scalar>& gradient, MatrixX<Scalar>* d_output) const {
    d_output->resize(2 * mean_.rows(), mean_.cols());
    d_output->topRows(mean_.rows()) = gradient.mean;
    // A product that is a NaN is not below 0, so that a NaN goes on.
    d_output->bottomRows(mean_.rows()) = gradient.log_std.binaryExpr(
        outside_, [](Scalar d, Scalar outside) { return d * outside < Scalar{0} ? Scalar{0} : d; });
  }

 private:
  MatrixX<Scalar> mean_;     // [dimensions x n]
  MatrixX<Scalar> log_std_;  // [dimensions x n]
  MatrixX<Scalar> outside_;  // [dimensions x n] 1 above the limits of the log-std, -1 below, else 0
};

}  // namespace dbr
