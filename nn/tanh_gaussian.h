// The continuous policy a = tanh(u), u a diagonal Gaussian: samples, log-probabilities and their gradients.
#pragma once

#include "nn/gaussian.h"

namespace dbr {

// The functions here are pure, work column by column, and exist for float and double; noise is an argument.
// Outputs are resized, which allocates nothing where they have their size already.

// The actions of data are clipped to +-kActionLimit before their likelihood is taken: on data of a
// deterministic policy the likelihood would have no upper bound otherwise.
inline constexpr double kActionLimit = 1 - 1e-5;

// One draw for each column.
template <class Scalar>
struct TanhSample {
  MatrixX<Scalar> before_tanh;  // [dimensions x n] u = mean + exp(log_std) * noise
  MatrixX<Scalar> action;       // [dimensions x n] tanh(u)
  VectorX<Scalar> log_prob;     // [n] density of the action, the tanh's change of variables included
  MatrixX<Scalar> terms;        // [dimensions x n] what each dimension adds to log_prob
};

// Draws a sample with its log-probabilities. noise [dimensions x n], standard normal.
template <class Scalar>
void SampleTanhGaussian(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                        TanhSample<Scalar>* sample);

// Draws a sample without its log-probabilities, whose logarithms take longer than the rest.
template <class Scalar>
void SampleTanhActions(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                       TanhSample<Scalar>* sample);

// The gradients of a loss with respect to a sample's actions, d_action [dimensions x n], and to its
// log-probabilities, d_log_prob [n]. BackpropTanhSample turns them into the gradient with respect to the
// parameters, through the sample (pathwise).
template <class Scalar>
struct TanhSampleGradient {
  ConstMatrixRef<Scalar> d_action;
  Eigen::Ref<const VectorX<Scalar>> d_log_prob;
};
template <class Scalar>
void BackpropTanhSample(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& noise,
                        const TanhSample<Scalar>& sample, const TanhSampleGradient<Scalar>& upstream,
                        GaussianGradient<Scalar>* gradient);

// log_prob [n] of given actions [dimensions x n] in [-1, 1], and the gradient of its sum, which serves as
// workspace too.
template <class Scalar>
void TanhLogProb(const GaussianView<Scalar>& gaussian, const ConstMatrixRef<Scalar>& actions,
                 VectorX<Scalar>* log_prob, GaussianGradient<Scalar>* gradient);

}  // namespace dbr
