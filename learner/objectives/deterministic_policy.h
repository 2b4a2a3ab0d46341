// TD3's deterministic policy: how it is represented, its smoothed target actions, and its loss with the
// gradient, alone or with a pull to the data's actions.
#pragma once

#include <algorithm>

#include "core/batch.h"
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

// The terms of the policy's loss. The defaults are TD3's.
struct DeterministicPolicyTerms {
  bool normalize_q = false;  // whether Q is divided by the mean of |Q| over the batch
  double q_weight = 1;
  double penalty = 0;  // the weight of the squared distance to the data's action
};

// Computes the loss, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class DeterministicPolicyObjective {
 public:
  // Returns -w E[Q_1(s, tanh(mean(s)))] / scale + penalty * E[|tanh(mean(s)) - a|^2], w = q_weight (Fujimoto
  // et al. 2018, algorithm 1; with the data's actions a: Fujimoto, Gu 2021, equation 3; Tarasov et al. 2023,
  // equation 3). The scale is the mean of |Q_1| with normalize_q, else 1, and a constant. Both twins are
  // evaluated: value1() and value2() of `critics` are then their values at the policy's actions.
  Scalar Evaluate(const DeterministicPolicyTerms& terms, const GaussianHead<Scalar>& pi,
                  const BasicBatch<Scalar>& batch, CriticEnsemble<Scalar>* critics) {
    terms_ = terms;
    noise_.setZero(pi.mean().rows(), pi.mean().cols());
    draws_.DrawActions(pi, noise_);
    critics->Evaluate(draws_.CriticInput(batch.observations));
    q_scale_ = static_cast<Scalar>(terms.q_weight);
    if (terms.normalize_q) q_scale_ /= std::max(critics->value1().cwiseAbs().mean(), kLeastMeanQ);
    difference_ = draws_.sample().action - batch.actions;
    distance_ = difference_.squaredNorm() / static_cast<Scalar>(batch.size());
    return -q_scale_ * critics->value1().mean() + static_cast<Scalar>(terms.penalty) * distance_;
  }

  // The mean of |tanh(mean(s)) - a|^2, the sum over the dimensions of the action, in the newest Evaluate.
  Scalar distance() const { return distance_; }

  // Sets `d_output` [2 * dimensions x n] to the gradient of the newest Evaluate with respect to the output of
  // the policy's network. It is 0 for the log-stds. The critic's weights are constants.
  void Gradient(const GaussianHead<Scalar>& pi, CriticEnsemble<Scalar>* critics, MatrixX<Scalar>* d_output) {
    const Eigen::Index n = pi.mean().cols();
    d_q_.setConstant(1, n, -q_scale_ / static_cast<Scalar>(n));
    d_log_prob_.setZero(n);
    gradient_.mean.setZero(pi.mean().rows(), n);
    gradient_.log_std.setZero(pi.mean().rows(), n);
    d_action_ = critics->FirstInputGradient(d_q_, pi.mean().rows());
    d_action_ += 2 * static_cast<Scalar>(terms_.penalty) / static_cast<Scalar>(n) * difference_;
    draws_.Backprop(d_action_, d_log_prob_, &gradient_);
    pi.Join(gradient_, d_output);
  }

 private:
  // A mean of |Q| below this, as in an untrained critic, would make the step of Q too large.
  static constexpr Scalar kLeastMeanQ = Scalar{1e-3};

  SampledActions<Scalar> draws_;
  DeterministicPolicyTerms terms_;
  Scalar q_scale_ = 1, distance_ = 0;
  VectorX<Scalar> d_log_prob_;  // [n]
  GaussianGradient<Scalar> gradient_;
  // noise_, difference_ and d_action_ [dimensions x n], d_q_ [1 x n].
  MatrixX<Scalar> noise_, difference_, d_action_, d_q_;
};

}  // namespace dbr
