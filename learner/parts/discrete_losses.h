// The losses of discrete DBR as pure functions with hand-written gradients (docs/algorithms.md maps them to
// the paper).
#pragma once

#include "core/batch.h"
#include "learner/parts/dual_behavior.h"
#include "nn/categorical.h"
#include "nn/mlp.h"
#include "proto/config.pb.h"

namespace dbr {

// V'(s') [n]: the expectation under pi' of min_weight * min_i Q'_i + (1 - min_weight) * max_i Q'_i.
// q1, q2 [actions x n] of the target critics.
template <class Scalar>
void ExpectedTargetValue(const Categorical<Scalar>& policy, const ConstMatrixRef<Scalar>& q1,
                         const ConstMatrixRef<Scalar>& q2, Scalar min_weight, VectorX<Scalar>* value);

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

// Workspaces of DualBehaviorPolicyLoss; reused from batch to batch.
template <class Scalar>
struct PolicyLossWorkspace {
  MatrixX<Scalar> d_plus, d_minus;       // [actions x n]
  VectorX<Scalar> plus, minus, entropy;  // [n]
};

// DBR's policy loss: -E[min_i sum_a pi Q_i] / scale - w H(pi) + alpha * (D(pi, beta+) - c), c by
// options.constraint (docs/algorithms.md, DBR step 3), and its gradient with respect to the policy's logits.
// q1, q2, beta+, beta- and the scale of normalize_q (the mean of |Q| over the batch) are constants; so is c
// unless repel_negative.
template <class Scalar>
PolicyLoss<Scalar> DualBehaviorPolicyLoss(const PolicyLossOptions& options, const Categorical<Scalar>& policy,
                                          const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                                          const Categorical<Scalar>& beta_plus,
                                          const Categorical<Scalar>& beta_minus, Scalar alpha,
                                          PolicyLossWorkspace<Scalar>* workspace, MatrixX<Scalar>* d_logits);

}  // namespace dbr
