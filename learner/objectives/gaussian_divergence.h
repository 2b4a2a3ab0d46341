// D(pi, beta) between Gaussian policies, or between a policy and actions, by the divergence that the config
// names.
#pragma once

#include "nn/divergence.h"
#include "nn/gaussian_head.h"
#include "proto/config.pb.h"

namespace dbr {

struct GaussianDivergenceOptions {
  DbrConfig::Divergence kind = DbrConfig::KL;
  double mmd_sigma = 1;
};

// True where D is estimated from samples and needs noise.
inline bool IsSampled(DbrConfig::Divergence kind) {
  return kind == DbrConfig::MMD_LAPLACIAN || kind == DbrConfig::MMD_GAUSSIAN;
}

// Computes the divergence, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class GaussianDivergence {
 public:
  // The noise of a sampled divergence, [dimensions x n * samples] for each policy. Sample i of state j is
  // column j * samples + i. Both are empty for an exact divergence.
  struct Noise {
    const MatrixX<Scalar>& pi;
    const MatrixX<Scalar>& beta;
  };

  // Sets value() [n] and gradient(), the gradient of the sum of value() with respect to pi's parameters. Both
  // are for the actions before the tanh.
  void Compute(const GaussianDivergenceOptions& options, const GaussianHead<Scalar>& pi,
               const GaussianHead<Scalar>& beta, const Noise& noise);

  // Does the same for a beta of which only samples are known: [dimensions x n * samples] before the tanh,
  // laid out as pi's noise. options.kind must be a sampled divergence.
  void ComputeFrom(const GaussianDivergenceOptions& options, const GaussianHead<Scalar>& pi,
                   const MatrixX<Scalar>& pi_noise, const MatrixX<Scalar>& beta_samples);

  // Sets value() [n] to the mean over dimensions of (tanh(mu) - a)^2 for the actions a [dimensions x n] in
  // [-1, 1], and gradient() likewise.
  void ComputeToActions(const GaussianHead<Scalar>& pi, const MatrixX<Scalar>& actions);

  // Multiplies value() and gradient() of each state by its weight [n] over the mean weight, so that the mean
  // of value() becomes the weighted mean. All become 0 where every weight is 0.
  void WeightBy(const VectorX<Scalar>& weights);

  // Replaces value() by min(value(), limit). The gradient of a state beyond the limit becomes 0.
  void LimitTo(Scalar limit) {
    for (Eigen::Index j = 0; j < value_.size(); ++j) {
      if (!(value_[j] > limit)) continue;
      value_[j] = limit;
      gradient_.mean.col(j).setZero();
      gradient_.log_std.col(j).setZero();
    }
  }

  // Adds weight times gradient() to `sum`.
  void AddGradient(Scalar weight, GaussianGradient<Scalar>* sum) const {
    sum->mean += weight * gradient_.mean;
    sum->log_std += weight * gradient_.log_std;
  }

  const VectorX<Scalar>& value() const { return value_; }
  const GaussianGradient<Scalar>& gradient() const { return gradient_; }

 private:
  VectorX<Scalar> value_;  // [n]
  GaussianGradient<Scalar> gradient_;
  MatrixX<Scalar> pi_samples_, beta_samples_, d_samples_;  // [dimensions x n * samples]
};

}  // namespace dbr
