// SAC's policy loss with its gradient.
#pragma once

#include "learner/parts/continuous_losses.h"
#include "learner/parts/sampled_actions.h"
#include "learner/parts/soft_policy_loss.h"
#include "learner/parts/twin_critic.h"

namespace dbr {

// Workspaces, reused from batch to batch.
template <class Scalar>
class SoftPolicyObjective {
 public:
  // E[temperature * log pi(a|s) - min_i Q_i(s, a)], one a drawn from pi for each state by noise [dimensions x
  // n] (Haarnoja et al. 2018, equation 9), and its gradient with respect to the output of pi's network [2 *
  // dimensions x n]. The critics' weights and the temperature are constants.
  SoftPolicyLoss<Scalar> Compute(const GaussianHead<Scalar>& pi, const MatrixX<Scalar>& observations,
                                 const MatrixX<Scalar>& noise, Scalar temperature,
                                 TwinCritic<Scalar>* critics, MatrixX<Scalar>* d_output) {
    const Eigen::Index n = observations.cols();
    draws_.Draw(pi, noise);
    critics->Evaluate(draws_.CriticInput(observations));
    SmallerMeanQTerm<Scalar>({}, critics->value1(), critics->value2(), n, &q_term_);
    d_log_prob_.setConstant(n, temperature / static_cast<Scalar>(n));
    gradient_.mean.setZero(noise.rows(), n);
    gradient_.log_std.setZero(noise.rows(), n);
    draws_.Backprop(critics->InputGradient(q_term_.d_q1, q_term_.d_q2), d_log_prob_, &gradient_);
    pi.Join(gradient_, d_output);
    const Scalar entropy = -draws_.sample().log_prob.mean();
    return {q_term_.loss - temperature * entropy, q_term_.value, entropy};
  }

 private:
  SampledActions<Scalar> draws_;
  QTerm<Scalar> q_term_;
  VectorX<Scalar> d_log_prob_;
  GaussianGradient<Scalar> gradient_;
};

}  // namespace dbr
