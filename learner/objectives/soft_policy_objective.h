// SAC's policy loss with its gradient.
#pragma once

#include "learner/objectives/sampled_q_objective.h"
#include "learner/objectives/soft_policy_loss.h"
#include "learner/training/critic_ensemble.h"

namespace dbr {

// Computes the loss, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class SoftPolicyObjective {
 public:
  // Returns E[temperature * log pi(a|s) - min_i Q_i(s, a)] with one a drawn from pi for each state (Haarnoja
  // et al. 2018, equation 9). noise [dimensions x n]. `d_output` [2 * dimensions x n] becomes the gradient
  // with respect to the output of pi's network. The critics' weights and the temperature are constants.
  SoftPolicyLoss<Scalar> Compute(const GaussianHead<Scalar>& pi, const MatrixX<Scalar>& observations,
                                 const MatrixX<Scalar>& noise, Scalar temperature,
                                 CriticEnsemble<Scalar>* critics, MatrixX<Scalar>* d_output) {
    const SoftPolicyLoss<Scalar> loss =
        q_objective_.Compute({.entropy_weight = temperature}, {pi, observations, noise}, critics, &gradient_);
    pi.Join(gradient_, d_output);
    return loss;
  }

  // Evaluates the critics at draws from pi, without a loss.
  void Evaluate(const PolicyDraws<Scalar>& at, CriticEnsemble<Scalar>* critics) {
    q_objective_.Evaluate(at, critics);
  }

 private:
  SampledQObjective<Scalar> q_objective_;
  GaussianGradient<Scalar> gradient_;
};

}  // namespace dbr
