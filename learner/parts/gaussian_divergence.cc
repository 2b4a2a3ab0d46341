#include "learner/parts/gaussian_divergence.h"

#include <cmath>

#include "core/check.h"

namespace dbr {
namespace {

// mean + std * noise, a group of columns of the noise for each state.
template <class Scalar>
void Spread(const GaussianHead<Scalar>& head, const MatrixX<Scalar>& noise, MatrixX<Scalar>* samples) {
  const Eigen::Index count = noise.cols() / head.mean().cols();
  samples->resize(noise.rows(), noise.cols());
  for (Eigen::Index j = 0; j < noise.cols(); ++j) {
    samples->col(j) = head.mean().col(j / count) +
                      head.log_std().col(j / count).array().exp().matrix().cwiseProduct(noise.col(j));
  }
}

}  // namespace

template <class Scalar>
void GaussianDivergence<Scalar>::Compute(const GaussianDivergenceOptions& options,
                                         const GaussianHead<Scalar>& pi, const GaussianHead<Scalar>& beta,
                                         const Noise& noise) {
  switch (options.kind) {
    case DbrConfig::KL:
      GaussianKl<Scalar>(pi.view(), beta.view(), &value_, &gradient_, nullptr);
      return;
    case DbrConfig::MMD_EXACT:
      ExactMmd<Scalar>(pi.view(), beta.view(), options.mmd_sigma, &value_, &gradient_);
      return;
    case DbrConfig::MMD_LAPLACIAN:
      return ComputeSampled({KernelKind::kLaplacian, options.mmd_sigma}, pi, beta, noise);
    case DbrConfig::MMD_GAUSSIAN:
      return ComputeSampled({KernelKind::kGaussian, options.mmd_sigma}, pi, beta, noise);
  }
}

template <class Scalar>
void GaussianDivergence<Scalar>::ComputeSampled(const Kernel& kernel, const GaussianHead<Scalar>& pi,
                                                const GaussianHead<Scalar>& beta, const Noise& noise) {
  const Eigen::Index n = pi.mean().cols();
  DBR_CHECK(noise.pi.cols() % n == 0 && noise.beta.cols() % n == 0 && noise.pi.cols() > 0);
  Spread(pi, noise.pi, &pi_samples_);
  Spread(beta, noise.beta, &beta_samples_);
  SampledMmd<Scalar>({pi_samples_, beta_samples_, n}, kernel, &value_, &d_samples_);
  const Eigen::Index count = noise.pi.cols() / n;
  gradient_.mean.setZero(pi.mean().rows(), n);
  gradient_.log_std.setZero(pi.mean().rows(), n);
  for (Eigen::Index j = 0; j < d_samples_.cols(); ++j) {
    gradient_.mean.col(j / count) += d_samples_.col(j);
    gradient_.log_std.col(j / count) += d_samples_.col(j).cwiseProduct(noise.pi.col(j));
  }
  gradient_.log_std.array() *= pi.log_std().array().exp();
}

template class GaussianDivergence<float>;
template class GaussianDivergence<double>;

}  // namespace dbr
