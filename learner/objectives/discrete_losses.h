// The losses over discrete actions, as pure functions with hand-written gradients (docs/algorithms.md maps
// them to their sources). Masks are [actions x n]; actions are [1 x n], the index of each.
#pragma once

#include <vector>

#include "core/batch.h"
#include "learner/objectives/dual_behavior.h"
#include "learner/objectives/soft_policy_loss.h"
#include "nn/categorical.h"
#include "nn/mlp.h"
#include "proto/config.pb.h"

namespace dbr {

// Sets `value` [n] to V'(s'): the expectation under pi' of min_weight * min_i Q'_i + (1 - min_weight) * max_i
// Q'_i. q1 and q2 [actions x n] are the target critics' values.
template <class Scalar>
void ExpectedTargetValue(const Categorical<Scalar>& policy, const ConstMatrixRef<Scalar>& q1,
                         const ConstMatrixRef<Scalar>& q2, Scalar min_weight, VectorX<Scalar>* value);

// Sets `value` [n] to the value that `judge` gives to the legal action with the greatest value in `chooser`,
// or to 0 where no action is legal. With the online network as the chooser and its target as the judge this
// is Double DQN's V'(s') (van Hasselt et al. 2016, equation 4). With one network as both it is max_a Q(s, a).
// All matrices are [actions x n].
template <class Scalar>
void GreedyValue(const ConstMatrixRef<Scalar>& chooser, const ConstMatrixRef<Scalar>& judge,
                 const ConstMatrixRef<Scalar>& masks, VectorX<Scalar>* value);

// Sets `advantages` to A = min_i Q_i(s, a) - V(s) for each transition. q1 and q2 are [actions x n], and value
// [n] is V(s). `advantages` gets the size n.
template <class Scalar>
void ComputeAdvantages(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                       const ConstMatrixRef<Scalar>& actions, const VectorX<Scalar>& value,
                       std::vector<float>* advantages);

// Returns the mean of (Q(s, a) - y)^2 over the batch. Sets `d_q` to its gradient with respect to q
// [actions x n]. y [n] is a constant.
template <class Scalar>
Scalar CriticLoss(const ConstMatrixRef<Scalar>& q, const ConstMatrixRef<Scalar>& actions,
                  const VectorX<Scalar>& y, MatrixX<Scalar>* d_q);

// Sets `divergence` [n] to D(p, q) for each state. Where `d_probabilities` is not null, sets it to the
// gradient of their sum with respect to p's probabilities [actions x n]. For KL that is log p - log q: the
// missing +1 vanishes in SoftmaxGradient.
template <class Scalar>
void Divergence(DbrConfig::Divergence kind, Scalar mmd_sigma, const Categorical<Scalar>& p,
                const Categorical<Scalar>& q, VectorX<Scalar>* divergence, MatrixX<Scalar>* d_probabilities);

// The workspaces of the policy losses. They are reused from batch to batch.
template <class Scalar>
struct PolicyLossWorkspace {
  MatrixX<Scalar> d_plus, d_minus;       // [actions x n]
  VectorX<Scalar> plus, minus, entropy;  // [n]
};

// A policy and the twins' values at the states of a batch.
template <class Scalar>
struct ValuedPolicy {
  const Categorical<Scalar>& policy;
  ConstMatrixRef<Scalar> q1, q2;  // [actions x n]
};

// The constraint D(pi, beta) <= threshold with its multiplier alpha.
template <class Scalar>
struct BehaviorConstraint {
  const Categorical<Scalar>& beta;
  Scalar threshold;  // c
  Scalar alpha;
};

// Returns BEAR's policy loss, -(E[min_i sum_a pi Q_i] + w H(pi)) / scale + alpha * (D(pi, beta) - c)
// (docs/algorithms.md). Sets `d_logits` [actions x n] to its gradient with respect to the policy's logits.
// Everything but the policy is a constant. So is the scale: with normalize_q the mean over the batch of sum_a
// pi |Q_i| with the smaller twin Q_i, at least 1e-6; else 1.
template <class Scalar>
ConstrainedLoss<Scalar> ConstrainedPolicyLoss(const PolicyLossOptions& options,
                                              const ValuedPolicy<Scalar>& at,
                                              const BehaviorConstraint<Scalar>& constraint,
                                              PolicyLossWorkspace<Scalar>* workspace,
                                              MatrixX<Scalar>* d_logits);

// Returns DBR's policy loss, -(E[min_i sum_a pi Q_i] + w H(pi)) / scale + alpha * (D(pi, beta+) - c).
// options.constraint sets c (docs/algorithms.md, DBR step 3); NONE leaves that term out. With repel_negative
// and a max_repulsion, the D(pi, beta-) of which c is the mean is cut at max_repulsion in each state. Sets
// `d_logits` [actions x n] to the loss's gradient with respect to the policy's logits. q1 and q2 [actions x
// n], beta+, beta-, alpha and the scale are constants. c is a constant too, unless repel_negative is set.
template <class Scalar>
PolicyLoss<Scalar> DualBehaviorPolicyLoss(const PolicyLossOptions& options, const Categorical<Scalar>& policy,
                                          const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                                          const Categorical<Scalar>& beta_plus,
                                          const Categorical<Scalar>& beta_minus, Scalar alpha,
                                          PolicyLossWorkspace<Scalar>* workspace, MatrixX<Scalar>* d_logits);

// Returns discrete SAC's policy loss E[sum_a pi(a|s) (temperature * log pi(a|s) - min_i Q_i(s, a))]
// (Christodoulou 2019, equation 12). The smaller twin is taken for each action. Sets `d_logits` [actions x n]
// to its gradient with respect to the policy's logits. q1 and q2 [actions x n] and the temperature are
// constants. `entropy` [n] is a workspace.
template <class Scalar>
SoftPolicyLoss<Scalar> DiscreteSoftPolicyLoss(const Categorical<Scalar>& policy,
                                              const ConstMatrixRef<Scalar>& q1,
                                              const ConstMatrixRef<Scalar>& q2, Scalar temperature,
                                              VectorX<Scalar>* entropy, MatrixX<Scalar>* d_logits);

// Returns the mean over the batch of log(number of legal actions), in nats: the greatest entropy that a
// policy can have there. masks [actions x n]. A state without a legal action counts as 0.
template <class Scalar>
Scalar MeanGreatestEntropy(const ConstMatrixRef<Scalar>& masks);

}  // namespace dbr
