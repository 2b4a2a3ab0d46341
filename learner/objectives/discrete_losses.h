// The losses over discrete actions as pure functions with hand-written gradients (docs/algorithms.md maps
// them to their sources).
#pragma once

#include <vector>

#include "core/batch.h"
#include "learner/objectives/dual_behavior.h"
#include "learner/objectives/soft_policy_loss.h"
#include "nn/categorical.h"
#include "nn/mlp.h"
#include "proto/config.pb.h"

namespace dbr {

// V'(s') [n]: the expectation under pi' of min_weight * min_i Q'_i + (1 - min_weight) * max_i Q'_i.
// q1, q2 [actions x n] of the target critics.
template <class Scalar>
void ExpectedTargetValue(const Categorical<Scalar>& policy, const ConstMatrixRef<Scalar>& q1,
                         const ConstMatrixRef<Scalar>& q2, Scalar min_weight, VectorX<Scalar>* value);

// V(s) [n]: what `judge` says of the legal action that `chooser` finds the greatest, 0 where none is legal.
// With the online network as the chooser and its target as the judge it is Double DQN's V'(s') (van Hasselt
// et al. 2016, equation 4); with one network as both it is max_a Q(s, a). All [actions x n].
template <class Scalar>
void GreedyValue(const ConstMatrixRef<Scalar>& chooser, const ConstMatrixRef<Scalar>& judge,
                 const ConstMatrixRef<Scalar>& masks, VectorX<Scalar>* value);

// A = min_i Q_i(s, a) - V(s) of each transition; value [n] is V(s). `advantages` becomes of size n.
template <class Scalar>
void ComputeAdvantages(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                       const ConstMatrixRef<Scalar>& actions, const VectorX<Scalar>& value,
                       std::vector<float>* advantages);

// The mean of (Q(s, a) - y)^2 over the batch and its gradient with respect to q [actions x n]; y is a
// constant.
template <class Scalar>
Scalar CriticLoss(const ConstMatrixRef<Scalar>& q, const ConstMatrixRef<Scalar>& actions,
                  const VectorX<Scalar>& y, MatrixX<Scalar>* d_q);

// [n] D(p, q) of each sample, and where `d_probabilities` is not null the gradient of their sum with respect
// to p's probabilities [actions x n]. For KL it is log p - log q: the missing +1 vanishes in SoftmaxGradient.
template <class Scalar>
void Divergence(DbrConfig::Divergence kind, Scalar mmd_sigma, const Categorical<Scalar>& p,
                const Categorical<Scalar>& q, VectorX<Scalar>* divergence, MatrixX<Scalar>* d_probabilities);

// Workspaces of the policy losses; reused from batch to batch.
template <class Scalar>
struct PolicyLossWorkspace {
  MatrixX<Scalar> d_plus, d_minus;       // [actions x n]
  VectorX<Scalar> plus, minus, entropy;  // [n]
};

// A policy with the twins' values at the states of a batch.
template <class Scalar>
struct ValuedPolicy {
  const Categorical<Scalar>& policy;
  ConstMatrixRef<Scalar> q1, q2;  // [actions x n]
};

// D(pi, beta) <= threshold, with its multiplier.
template <class Scalar>
struct BehaviorConstraint {
  const Categorical<Scalar>& beta;
  Scalar threshold;  // c
  Scalar alpha;
};

// -E[min_i sum_a pi Q_i] / scale - w H(pi) + alpha * (D(pi, beta) - c), BEAR's policy loss
// (docs/algorithms.md), and its gradient with respect to the policy's logits. All but the policy are
// constants, the scale of normalize_q (the mean of |Q| over the batch) too.
template <class Scalar>
ConstrainedLoss<Scalar> ConstrainedPolicyLoss(const PolicyLossOptions& options,
                                              const ValuedPolicy<Scalar>& at,
                                              const BehaviorConstraint<Scalar>& constraint,
                                              PolicyLossWorkspace<Scalar>* workspace,
                                              MatrixX<Scalar>* d_logits);

// DBR's policy loss: -E[min_i sum_a pi Q_i] / scale - w H(pi) + alpha * (D(pi, beta+) - c), c by
// options.constraint (docs/algorithms.md, DBR step 3; NONE leaves that term out), and its gradient with
// respect to the policy's logits. q1, q2, beta+, beta- and the scale are constants; so is c unless
// repel_negative.
template <class Scalar>
PolicyLoss<Scalar> DualBehaviorPolicyLoss(const PolicyLossOptions& options, const Categorical<Scalar>& policy,
                                          const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                                          const Categorical<Scalar>& beta_plus,
                                          const Categorical<Scalar>& beta_minus, Scalar alpha,
                                          PolicyLossWorkspace<Scalar>* workspace, MatrixX<Scalar>* d_logits);

// Discrete SAC's policy loss E[sum_a pi(a|s) (temperature * log pi(a|s) - min_i Q_i(s, a))] (Christodoulou
// 2019, equation 12), the smaller twin taken for each action, and its gradient with respect to the policy's
// logits. q1, q2 [actions x n] and the temperature are constants. `entropy` [n] is a workspace.
template <class Scalar>
SoftPolicyLoss<Scalar> DiscreteSoftPolicyLoss(const Categorical<Scalar>& policy,
                                              const ConstMatrixRef<Scalar>& q1,
                                              const ConstMatrixRef<Scalar>& q2, Scalar temperature,
                                              VectorX<Scalar>* entropy, MatrixX<Scalar>* d_logits);

// The mean over the batch of log(number of legal actions), the greatest entropy that a policy can have there,
// in nats. masks [actions x n]; a state without a legal action counts as 0.
template <class Scalar>
Scalar MeanGreatestEntropy(const ConstMatrixRef<Scalar>& masks);

}  // namespace dbr
