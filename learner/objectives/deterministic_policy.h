// TD3's deterministic policy: how it is represented, its smoothed target actions, and its loss with the
// gradient.
#pragma once

#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/sampled_actions.h"
#include "learner/training/critic_ensemble.h"

namespace dbr {

// Makes a Gaussian network [input -> 2 * dimensions] deterministic, except for a deviation of e^-20. In the
// last layer, the rows that give the log-stds get weight 0 and a bias at the lower limit. They get no
// gradient and so do not change.
template <class Scalar>
void PinLogStd(const MlpShape& shape, VectorX<Scalar>* parameters) {
  const int last = shape.layer_count() - 1, dimensions = shape.output_size() / 2;
  Eigen::Map<MatrixX<Scalar>> weight(parameters->data() + shape.weight_offset(last), shape.out(last),
                                     shape.in(last));
  weight.bottomRows(dimensions).setZero();
  parameters->segment(shape.bias_offset(last) + dimensions, dimensions)
      .setConstant(static_cast<Scalar>(kPolicyLogStd.min));
}

struct SmoothingOptions {
  double deviation = 0;  // the noise's standard deviation, in units of the action
  double limit = 0;      // the noise is clipped to +-limit, in units of the action
};

// Sets `actions` to clip(tanh(mean) + clip(deviation * noise, +-limit), +-1) (Fujimoto et al. 2018, section
// 5.3). `noise` is standard normal. All matrices are [dimensions x n].
template <class Scalar>
void SmoothedActions(const MatrixX<Scalar>& mean, const MatrixX<Scalar>& noise,
                     const SmoothingOptions& options, MatrixX<Scalar>* actions) {
  const auto deviation = static_cast<Scalar>(options.deviation), limit = static_cast<Scalar>(options.limit);
  *actions = (mean.array().tanh() + (deviation * noise.array()).max(-limit).min(limit))
                 .max(Scalar{-1})
                 .min(Scalar{1})
                 .matrix();
}

// Computes the loss, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class DeterministicPolicyObjective {
 public:
  // Returns -E[Q_1(s, tanh(mean(s)))] (Fujimoto et al. 2018, algorithm 1; Silver et al. 2014). Both critics
  // are evaluated: value1() and value2() of `critics` are then their values at the policy's actions.
  Scalar Evaluate(const GaussianHead<Scalar>& pi, const MatrixX<Scalar>& observations,
                  CriticEnsemble<Scalar>* critics) {
    noise_.setZero(pi.mean().rows(), pi.mean().cols());
    draws_.DrawActions(pi, noise_);
    critics->Evaluate(draws_.CriticInput(observations));
    return -critics->value1().mean();
  }

  // Sets `d_output` [2 * dimensions x n] to the gradient of the newest Evaluate with respect to the output of
  // the policy's network. It is 0 for the log-stds. The critic's weights are constants.
  void Gradient(const GaussianHead<Scalar>& pi, CriticEnsemble<Scalar>* critics, MatrixX<Scalar>* d_output) {
    const Eigen::Index n = pi.mean().cols();
    d_q_.setConstant(1, n, Scalar{-1} / static_cast<Scalar>(n));
    d_log_prob_.setZero(n);
    gradient_.mean.setZero(pi.mean().rows(), n);
    gradient_.log_std.setZero(pi.mean().rows(), n);
    draws_.Backprop(critics->FirstInputGradient(d_q_, pi.mean().rows()), d_log_prob_, &gradient_);
    pi.Join(gradient_, d_output);
  }

 private:
  SampledActions<Scalar> draws_;
  VectorX<Scalar> d_log_prob_;  // [n]
  GaussianGradient<Scalar> gradient_;
  MatrixX<Scalar> noise_, d_q_;  // [dimensions x n], [1 x n]
};

}  // namespace dbr
