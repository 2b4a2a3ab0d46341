#include "nn/tanh_gaussian.h"

#include <numbers>

#include "core/check.h"

namespace dbr {
namespace {

template <class Scalar>
constexpr Scalar kHalfLogTwoPi = Scalar(0.91893853320467274178);

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
  // The logarithm of a normal's density less log(1 - tanh(u)^2) = 2 (log 2 - |u| - log(1 + exp(-2 |u|))),
  // which is exact where tanh(u) rounds to 1.
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
  // d action / du = 1 - tanh(u)^2 = 4 e / (1 + e)^2 with e = exp(-2 |u|): exact where tanh(u) rounds to 1.
  const auto e = (Scalar{-2} * sample.before_tanh.array().abs()).exp();
  // d log_prob / du = 2 tanh(u): the density of the noise does not move with the sample.
  const auto d_log_prob = upstream.d_log_prob.transpose().array().replicate(noise.rows(), 1);
  gradient->mean = (upstream.d_action.array() * (Scalar{4} * e / (1 + e).square()) +
                    Scalar{2} * d_log_prob * sample.action.array())
                       .matrix();
  gradient->log_std =
      (gradient->mean.array() * gaussian.log_std.array().exp() * noise.array() - d_log_prob).matrix();
}

template <class Scalar>
void TanhLogProb(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& actions,
                 VectorX<Scalar>* log_prob, GaussianGradient<Scalar>* gradient) {
  CheckShape<Scalar>(gaussian, actions);
  constexpr Scalar kLimit = static_cast<Scalar>(kActionLimit);
  constexpr Scalar kConstant = kHalfLogTwoPi<Scalar> + 2 * std::numbers::ln2_v<Scalar>;
  gradient->Resize(actions.rows(), actions.cols());
  auto first = gradient->mean.array(), second = gradient->log_std.array();
  first = actions.array().max(-kLimit).min(kLimit);
  first = (first.log1p() - (-first).log1p()) / 2;                     // u = atanh(a)
  second = 2 * (first.abs() + (1 + (-2 * first.abs()).exp()).log());  // 2 log 2 - log(1 - tanh(u)^2)
  first = (first - gaussian.mean.array()) * (-gaussian.log_std.array()).exp();  // z
  second -= first.square() / 2 + gaussian.log_std.array() + kConstant;
  *log_prob = gradient->log_std.colwise().sum().transpose();
  second = first.square() - 1;
  first *= (-gaussian.log_std.array()).exp();
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
