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

  const VectorX<Scalar>& value() const { return value_; }
  const GaussianGradient<Scalar>& gradient() const { return gradient_; }

 private:
  void ComputeSampled(const Kernel& kernel, const GaussianHead<Scalar>& pi, const GaussianHead<Scalar>& beta,
                      const Noise& noise);

  VectorX<Scalar> value_;
  GaussianGradient<Scalar> gradient_;
  MatrixX<Scalar> pi_samples_, beta_samples_, d_samples_;
};

}  // namespace dbr
