// The Q term and the entropy term of a policy's loss over continuous actions, with their gradient.
#pragma once

#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/sampled_actions.h"
#include "learner/objectives/soft_policy_loss.h"
#include "learner/training/critic_ensemble.h"

namespace dbr {

template <class Scalar>
struct SampledQOptions {
  QTermOptions q = {};
  Scalar entropy_weight = 0;
};

// The policy at n states, and the noise of `count` draws for each state.
template <class Scalar>
struct PolicyDraws {
  const GaussianHead<Scalar>& pi;
  const MatrixX<Scalar>& observations;  // [observation x n]
  const MatrixX<Scalar>& noise;         // [dimensions x count * n], draw k of state j in column k * n + j
};

// Computes the loss, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class SampledQObjective {
 public:
  // Evaluates the critics at draws from pi, without a loss.
  void Evaluate(const PolicyDraws<Scalar>& at, CriticEnsemble<Scalar>* critics) {
    draws_.Draw(at.pi, at.noise);
    critics->Evaluate(draws_.CriticInput(at.observations));
  }

  // Returns -(E[min_i mean_k Q_i(s, a_k)] + entropy_weight * H(pi)) / scale, with the a_k drawn from pi and
  // the entropy H estimated from the draws; 0 with use_q false. Overwrites `gradient` with the gradient with
  // respect to pi's parameters. The critics' weights, entropy_weight and the scale (SmallerMeanQTerm) are
  // constants.
  SoftPolicyLoss<Scalar> Compute(const SampledQOptions<Scalar>& options, const PolicyDraws<Scalar>& at,
                                 CriticEnsemble<Scalar>* critics, GaussianGradient<Scalar>* gradient) {
    const Eigen::Index n = at.observations.cols();
    Evaluate(at, critics);
    SmallerMeanQTerm<Scalar>(options.q, critics->value1(), critics->value2(), n, &q_term_);
    const VectorX<Scalar>& log_prob = draws_.sample().log_prob;
    const Scalar entropy_weight = options.q.use_q ? options.entropy_weight / q_term_.scale : Scalar{0};
    d_log_prob_.setConstant(log_prob.size(), entropy_weight / static_cast<Scalar>(log_prob.size()));
    gradient->mean.setZero(at.noise.rows(), n);
    gradient->log_std.setZero(at.noise.rows(), n);
    draws_.Backprop(critics->InputGradient(q_term_.d_q1, q_term_.d_q2, at.noise.rows()), d_log_prob_,
                    gradient);
    const Scalar entropy = -log_prob.mean();
    return {q_term_.loss - entropy_weight * entropy, q_term_.value, entropy};
  }

 private:
  SampledActions<Scalar> draws_;
  QTerm<Scalar> q_term_;
  VectorX<Scalar> d_log_prob_;  // [count * n]
};

}  // namespace dbr
