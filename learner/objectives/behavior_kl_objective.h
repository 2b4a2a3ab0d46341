// BRAC's policy loss with its gradient.
#pragma once

#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/sampled_actions.h"
#include "learner/training/critic_ensemble.h"
#include "nn/divergence.h"

namespace dbr {

template <class Scalar>
struct BehaviorKlLoss {
  Scalar loss = 0;
  Scalar value = 0;       // E[min_i mean_k Q_i(s, a_k)]
  Scalar divergence = 0;  // the estimate of the mean KL(pi || beta), nats
  Scalar entropy = 0;     // mean of -log pi(a|s) over the draws, nats
};

// What the loss is taken at: the two policies at the states of a batch, and the noise of pi's draws.
template <class Scalar>
struct BehaviorKlInputs {
  const GaussianHead<Scalar>& pi;
  const GaussianHead<Scalar>& beta;
  const MatrixX<Scalar>& noise;  // [dimensions x draws * n]
};

// Computes the loss, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class BehaviorKlObjective {
 public:
  // Returns -E[min_i mean_k Q_i(s, a_k)] + alpha * E[mean_k (log pi(a_k|s) - log beta(a_k|s))] (the policy's
  // objective of Wu et al. 2019, with the KL estimated from samples). Both terms use the same draws a_k from
  // pi. `d_output` [2 * dimensions x n] becomes the gradient with respect to the output of pi's network,
  // which flows through the draws. beta, the critics' weights and alpha are constants. With use_q false the
  // first term is 0.
  BehaviorKlLoss<Scalar> Compute(const BehaviorKlInputs<Scalar>& inputs, const MatrixX<Scalar>& observations,
                                 Scalar alpha, bool use_q, CriticEnsemble<Scalar>* critics,
                                 MatrixX<Scalar>* d_output) {
    const Eigen::Index n = observations.cols();
    draws_.Draw(inputs.pi, inputs.noise);
    critics->Evaluate(draws_.CriticInput(observations));
    SmallerMeanQTerm<Scalar>({.use_q = use_q}, critics->value1(), critics->value2(), n, &q_term_);
    SampledKl<Scalar>(inputs.pi.view(), inputs.beta.view(), inputs.noise, &kl_, &gradient_);
    gradient_.mean *= alpha / static_cast<Scalar>(n);
    gradient_.log_std *= alpha / static_cast<Scalar>(n);
    d_log_prob_.setZero(inputs.noise.cols());
    draws_.Backprop(critics->InputGradient(q_term_.d_q1, q_term_.d_q2, gradient_.mean.rows()), d_log_prob_,
                    &gradient_);
    inputs.pi.Join(gradient_, d_output);
    const Scalar divergence = kl_.mean();
    return {q_term_.loss + alpha * divergence, q_term_.value, divergence, -draws_.sample().log_prob.mean()};
  }

 private:
  SampledActions<Scalar> draws_;
  QTerm<Scalar> q_term_;
  VectorX<Scalar> kl_, d_log_prob_;  // [n], [draws * n]
  GaussianGradient<Scalar> gradient_;
};

}  // namespace dbr
