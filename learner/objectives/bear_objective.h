// BEAR's policy loss over continuous actions with its gradient.
#pragma once

#include "learner/objectives/dual_behavior.h"
#include "learner/objectives/gaussian_divergence.h"
#include "learner/objectives/sampled_q_objective.h"

namespace dbr {

// What the loss is taken at: the policy at the states of a batch with the noise of its draws, and samples of
// the behaviour model. Both sides of the divergence have `samples` columns for each state. Sample i of state
// s is column s * samples + i.
template <class Scalar>
struct BearDraws {
  PolicyDraws<Scalar> policy;
  const MatrixX<Scalar>& divergence_noise;  // the noise of pi's samples
  const MatrixX<Scalar>& behavior;          // [dimensions x n * samples] actions before their tanh
};

// Computes the loss, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class BearObjective {
 public:
  // Returns -E[min_i mean_k Q_i(s, a_k)] + alpha * (D(pi, beta) - eps) (Kumar et al. 2019, equation 1). D is
  // the mean over the batch of the sampled MMD between the actions before the tanh (nn/divergence.h). With
  // options.use_q false the first term is 0. `d_output` [2 * dimensions x n] becomes the gradient with
  // respect to the output of pi's network. The critics' weights, beta's samples and alpha are constants.
  ConstrainedLoss<Scalar> Compute(const PolicyLossOptions& options, const BearDraws<Scalar>& at, Scalar alpha,
                                  CriticEnsemble<Scalar>* critics, MatrixX<Scalar>* d_output) {
    const GaussianHead<Scalar>& pi = at.policy.pi;
    const SoftPolicyLoss<Scalar> q =
        q_objective_.Compute({.q = {.use_q = options.use_q}}, at.policy, critics, &gradient_);
    divergence_.ComputeFrom({options.divergence, options.mmd_sigma}, pi, at.divergence_noise, at.behavior);
    divergence_.AddGradient(alpha / static_cast<Scalar>(pi.mean().cols()), &gradient_);
    pi.Join(gradient_, d_output);
    const Scalar divergence = divergence_.value().mean();
    const auto epsilon = static_cast<Scalar>(options.epsilon);
    return {.loss = q.loss + alpha * (divergence - epsilon),
            .value = q.value,
            .divergence = divergence,
            .threshold = epsilon,
            .entropy = q.entropy};
  }

 private:
  SampledQObjective<Scalar> q_objective_;
  GaussianDivergence<Scalar> divergence_;
  GaussianGradient<Scalar> gradient_;
};

}  // namespace dbr
