// D(pi, beta) between Gaussian policies, by the divergence that the config names.
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

// Workspaces, reused from batch to batch.
template <class Scalar>
class GaussianDivergence {
 public:
  // Noise of a sampled divergence, [dimensions x n * samples] each, sample i of state j in column
  // j * samples + i; empty for an exact one.
  struct Noise {
    const MatrixX<Scalar>& pi;
    const MatrixX<Scalar>& beta;
  };

  // value() [n], and gradient(): that of its sum with respect to pi's parameters. Both are of the actions
  // before the tanh.
  void Compute(const GaussianDivergenceOptions& options, const GaussianHead<Scalar>& pi,
               const GaussianHead<Scalar>& beta, const Noise& noise);

  // The same for a beta that is known by samples alone, [dimensions x n * samples] before the tanh, laid out
  // as the noise of pi; options.kind is a sampled one.
  void ComputeFrom(const GaussianDivergenceOptions& options, const GaussianHead<Scalar>& pi,
                   const MatrixX<Scalar>& pi_noise, const MatrixX<Scalar>& beta_samples);

  // Adds weight times gradient() to `sum`.
  void AddGradient(Scalar weight, GaussianGradient<Scalar>* sum) const {
    sum->mean += weight * gradient_.mean;
    sum->log_std += weight * gradient_.log_std;
  }

  const VectorX<Scalar>& value() const { return value_; }
  const GaussianGradient<Scalar>& gradient() const { return gradient_; }

 private:
  VectorX<Scalar> value_;
  GaussianGradient<Scalar> gradient_;
  MatrixX<Scalar> pi_samples_, beta_samples_, d_samples_;
};

}  // namespace dbr
