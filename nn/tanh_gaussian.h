// The continuous policy a = tanh(u), u a diagonal Gaussian: samples, log-probabilities and their gradients.
#pragma once

#include "nn/gaussian.h"

namespace dbr {

// Pure functions of columns, float and double; noise is an argument. Outputs are resized, which allocates
// nothing where they have their size already.

// Data's actions are clipped to +-kActionLimit: on data of a deterministic policy the likelihood has no upper
// bound else.
inline constexpr double kActionLimit = 1 - 1e-5;

template <class Scalar>
struct TanhSample {
  MatrixX<Scalar> before_tanh;  // [dimensions x n] u = mean + exp(log_std) * noise
  MatrixX<Scalar> action;       // [dimensions x n] tanh(u)
  VectorX<Scalar> log_prob;     // [n] density of the action, the tanh's change of variables included
  MatrixX<Scalar> terms;        // [dimensions x n] of log_prob
};

// noise [dimensions x n], standard normal.
template <class Scalar>
void SampleTanhGaussian(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                        TanhSample<Scalar>* sample);

// Without the log-probabilities, whose logarithms take longer than the rest.
template <class Scalar>
void SampleTanhActions(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                       TanhSample<Scalar>* sample);

// The gradient through a sample (pathwise): from those with respect to its actions, d_action [dimensions x
// n], and its log-probabilities, d_log_prob [n], to one with respect to the parameters.
template <class Scalar>
struct TanhSampleGradient {
  ConstMatrixRef<Scalar> d_action;
  Eigen::Ref<const VectorX<Scalar>> d_log_prob;
};
template <class Scalar>
void BackpropTanhSample(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                        const TanhSample<Scalar>& sample, const TanhSampleGradient<Scalar>& upstream,
                        GaussianGradient<Scalar>* gradient);

// log_prob [n] of given actions [dimensions x n] in [-1, 1], and the gradient of its sum (may be null).
template <class Scalar>
void TanhLogProb(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& actions,
                 VectorX<Scalar>* log_prob, GaussianGradient<Scalar>* gradient);

}  // namespace dbr
