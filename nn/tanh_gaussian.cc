#include "nn/tanh_gaussian.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/check.h"

namespace dbr {
namespace {

// log(1 - tanh(u)^2) = 2 (log 2 - |u| - log(1 + exp(-2 |u|))): exact where tanh(u) rounds to 1.
template <class Scalar>
Scalar LogTanhSlope(Scalar u) {
  const Scalar size = std::abs(u);
  return 2 * (std::numbers::ln2_v<Scalar> - size - std::log1p(std::exp(-2 * size)));
}

template <class Scalar>
constexpr Scalar kHalfLogTwoPi = Scalar(0.91893853320467274178);

// The log-density of a normal at `z` deviations from its mean.
template <class Scalar>
Scalar LogNormal(Scalar z, Scalar log_std) {
  return -z * z / 2 - log_std - kHalfLogTwoPi<Scalar>;
}

template <class Scalar>
void CheckShape(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& beside) {
  DBR_CHECK(gaussian.mean.rows() == gaussian.log_std.rows() &&
            gaussian.mean.cols() == gaussian.log_std.cols());
  DBR_CHECK(gaussian.mean.rows() == beside.rows() && gaussian.mean.cols() == beside.cols());
}

}  // namespace

template <class Scalar>
void SampleTanhActions(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                       TanhSample<Scalar>* sample) {
  CheckShape<Scalar>(gaussian, noise);
  sample->before_tanh = (gaussian.mean.array() + gaussian.log_std.array().exp() * noise.array()).matrix();
  sample->action = sample->before_tanh.array().tanh().matrix();
}

template <class Scalar>
void SampleTanhGaussian(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                        TanhSample<Scalar>* sample) {
  SampleTanhActions(gaussian, noise, sample);
  constexpr Scalar kConstant = kHalfLogTwoPi<Scalar> + 2 * std::numbers::ln2_v<Scalar>;
  // The logarithms of a normal's density less log(1 - tanh(u)^2), as LogTanhSlope has it, for whole matrices.
  const auto size = sample->before_tanh.array().abs();
  sample->terms = (-noise.array().square() / 2 - gaussian.log_std.array() - kConstant +
                   2 * (size + (1 + (-2 * size).exp()).log()))
                      .matrix();
  sample->log_prob = sample->terms.colwise().sum().transpose();
}

template <class Scalar>
void BackpropTanhSample(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                        const TanhSample<Scalar>& sample, const TanhSampleGradient<Scalar>& upstream,
                        GaussianGradient<Scalar>* gradient) {
  CheckShape<Scalar>(gaussian, noise);
  CheckShape<Scalar>(gaussian, upstream.d_action);
  DBR_CHECK(upstream.d_log_prob.size() == noise.cols());
  gradient->Resize(noise.rows(), noise.cols());
  for (Eigen::Index j = 0; j < noise.cols(); ++j) {
    const Scalar d_log_prob = upstream.d_log_prob[j];
    for (Eigen::Index d = 0; d < noise.rows(); ++d) {
      // d log_prob / du = 2 tanh(u): the density of the noise does not move with the sample.
      const Scalar slope = std::exp(LogTanhSlope(sample.before_tanh(d, j)));
      const Scalar d_u = upstream.d_action(d, j) * slope + d_log_prob * 2 * sample.action(d, j);
      gradient->mean(d, j) = d_u;
      gradient->log_std(d, j) = d_u * std::exp(gaussian.log_std(d, j)) * noise(d, j) - d_log_prob;
    }
  }
}

template <class Scalar>
void TanhLogProb(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& actions,
                 VectorX<Scalar>* log_prob, GaussianGradient<Scalar>* gradient) {
  CheckShape<Scalar>(gaussian, actions);
  constexpr Scalar kLimit = static_cast<Scalar>(kActionLimit);
  log_prob->resize(actions.cols());
  if (gradient != nullptr) gradient->Resize(actions.rows(), actions.cols());
  for (Eigen::Index j = 0; j < actions.cols(); ++j) {
    Scalar sum = 0;
    for (Eigen::Index d = 0; d < actions.rows(); ++d) {
      const Scalar u = std::atanh(std::clamp(actions(d, j), -kLimit, kLimit));
      const Scalar precision = std::exp(-gaussian.log_std(d, j));  // 1 / standard deviation
      const Scalar z = (u - gaussian.mean(d, j)) * precision;
      sum += LogNormal(z, gaussian.log_std(d, j)) - LogTanhSlope(u);
      if (gradient == nullptr) continue;
      gradient->mean(d, j) = z * precision;
      gradient->log_std(d, j) = z * z - 1;
    }
    (*log_prob)[j] = sum;
  }
}

#define DBR_INSTANTIATE(Scalar)                                                                          \
  template void SampleTanhActions<Scalar>(const GaussianView<Scalar>&, const ConstMatrixRef<Scalar>&,    \
                                          TanhSample<Scalar>*);                                          \
  template void SampleTanhGaussian<Scalar>(const GaussianView<Scalar>&, const ConstMatrixRef<Scalar>&,   \
                                           TanhSample<Scalar>*);                                         \
  template void BackpropTanhSample<Scalar>(const GaussianView<Scalar>&, const ConstMatrixRef<Scalar>&,   \
                                           const TanhSample<Scalar>&, const TanhSampleGradient<Scalar>&, \
                                           GaussianGradient<Scalar>*);                                   \
  template void TanhLogProb<Scalar>(const GaussianView<Scalar>&, const ConstMatrixRef<Scalar>&,          \
                                    VectorX<Scalar>*, GaussianGradient<Scalar>*);
DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
