// BEAR's policy loss over continuous actions with its gradient.
#pragma once

#include "learner/objectives/dual_behavior.h"
#include "learner/objectives/gaussian_divergence.h"
#include "learner/objectives/sampled_q_objective.h"

namespace dbr {

// The policy at the states of a batch, what it draws, and samples of the behaviour model; both sides of the
// divergence have `samples` columns a state, sample i of state s in column s * samples + i.
template <class Scalar>
struct BearDraws {
  PolicyDraws<Scalar> policy;
  const MatrixX<Scalar>& divergence_noise;  // [dimensions x n * samples] of pi
  const MatrixX<Scalar>& behavior;          // [dimensions x n * samples] actions before their tanh
};

// Workspaces, reused from batch to batch.
template <class Scalar>
class BearObjective {
 public:
  // -E[min_i mean_k Q_i(s, a_k)] + alpha * (D(pi, beta) - eps), D the sampled MMD of the actions before the
  // tanh (nn/divergence.h) and its mean over the batch, and the gradient with respect to the output of pi's
  // network [2 * dimensions x n]. The critics' weights, beta's samples and alpha are constants.
  ConstrainedLoss<Scalar> Compute(const PolicyLossOptions& options, const BearDraws<Scalar>& at, Scalar alpha,
                                  TwinCritic<Scalar>* critics, MatrixX<Scalar>* d_output) {
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
