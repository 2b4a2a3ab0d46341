#include "learner/objectives/gaussian_divergence.h"

#include <cmath>

#include "core/check.h"

namespace dbr {
namespace {

// Sets `samples` to mean + std * noise. Each state has a group of neighbouring columns of the noise.
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
    case DbrConfig::MMD_SQUARED:
      SquaredMmd<Scalar>(pi.view(), beta.view(), options.mmd_sigma, &value_, &gradient_);
      return;
    case DbrConfig::MMD_LAPLACIAN:
    case DbrConfig::MMD_GAUSSIAN:
      Spread(beta, noise.beta, &beta_samples_);
      ComputeFrom(options, pi, noise.pi, beta_samples_);
      return;
    case DbrConfig::ACTIONS:
      DBR_CHECK(false);  // there is no beta: ComputeToActions
  }
}

template <class Scalar>
void GaussianDivergence<Scalar>::ComputeToActions(const GaussianHead<Scalar>& pi,
                                                  const MatrixX<Scalar>& actions) {
  DBR_CHECK(actions.rows() == pi.mean().rows() && actions.cols() == pi.mean().cols());
  gradient_.mean = pi.mean().array().tanh();  // the mode, for now
  const Scalar each = Scalar{2} / static_cast<Scalar>(actions.rows());
  value_ =
      (gradient_.mean - actions).colwise().squaredNorm().transpose() / static_cast<Scalar>(actions.rows());
  gradient_.mean = each * (gradient_.mean - actions).array() * (Scalar{1} - gradient_.mean.array().square());
  gradient_.log_std.setZero(actions.rows(), actions.cols());
}

template <class Scalar>
void GaussianDivergence<Scalar>::WeightBy(const VectorX<Scalar>& weights) {
  const Scalar mean = weights.mean();
  const Scalar scale = mean == 0 ? Scalar{0} : Scalar{1} / mean;  // a NaN goes on
  value_.array() *= scale * weights.array();
  for (Eigen::Index j = 0; j < weights.size(); ++j) {
    gradient_.mean.col(j) *= scale * weights[j];
    gradient_.log_std.col(j) *= scale * weights[j];
  }
}

template <class Scalar>
void GaussianDivergence<Scalar>::ComputeFrom(const GaussianDivergenceOptions& options,
                                             const GaussianHead<Scalar>& pi, const MatrixX<Scalar>& pi_noise,
                                             const MatrixX<Scalar>& beta_samples) {
  const Eigen::Index n = pi.mean().cols();
  DBR_CHECK(IsSampled(options.kind) && pi_noise.cols() % n == 0 && beta_samples.cols() % n == 0 &&
            pi_noise.cols() > 0);
  const KernelKind kernel =
      options.kind == DbrConfig::MMD_GAUSSIAN ? KernelKind::kGaussian : KernelKind::kLaplacian;
  Spread(pi, pi_noise, &pi_samples_);
  SampledMmd<Scalar>({pi_samples_, beta_samples, n}, {kernel, options.mmd_sigma}, &value_, &d_samples_);
  const Eigen::Index count = pi_noise.cols() / n;
  gradient_.mean.setZero(pi.mean().rows(), n);
  gradient_.log_std.setZero(pi.mean().rows(), n);
  for (Eigen::Index j = 0; j < d_samples_.cols(); ++j) {
    gradient_.mean.col(j / count) += d_samples_.col(j);
    gradient_.log_std.col(j / count) += d_samples_.col(j).cwiseProduct(pi_noise.col(j));
  }
  gradient_.log_std.array() *= pi.log_std().array().exp();
}

template class GaussianDivergence<float>;
template class GaussianDivergence<double>;

}  // namespace dbr
