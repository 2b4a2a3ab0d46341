// The categorical policy over the legal actions, and the leaves of its losses with hand-written gradients.
#pragma once

#include "core/batch.h"
#include "nn/mlp.h"

namespace dbr {

// log p and p of a softmax over the legal actions alone; one column for each sample. Illegal entries: p = 0,
// log p = 0 (they never contribute). A column without any legal action (after an episode's end) is all zeros.
template <class Scalar>
struct Categorical {
  MatrixX<Scalar> log_probabilities;  // [actions x n]
  MatrixX<Scalar> probabilities;      // [actions x n]
};

// logits and masks [actions x n].
template <class Scalar>
void MaskedSoftmax(const ConstMatrixRef<Scalar>& logits, const ConstMatrixRef<Scalar>& masks,
                   Categorical<Scalar>* distribution);

// The mean over the batch of -w log p(a|s), and its gradient with respect to the logits [actions x n] (may be
// null). actions [1 x n] hold indices of legal actions; weights w [n] are constants, null: all 1.
template <class Scalar>
Scalar NegativeLogLikelihood(const Categorical<Scalar>& distribution, const ConstMatrixRef<Scalar>& actions,
                             MatrixX<Scalar>* d_logits, const VectorX<Scalar>* weights = nullptr);

// [n] entropies in nats: -sum_a p log p.
template <class Scalar>
void Entropy(const Categorical<Scalar>& p, VectorX<Scalar>* entropy);

// [n] divergences KL(p || q) = sum_a p (log p - log q), in nats, over the legal actions.
template <class Scalar>
void KlDivergence(const Categorical<Scalar>& p, const Categorical<Scalar>& q, VectorX<Scalar>* kl);

// Turns a gradient with respect to the probabilities of p into one with respect to its logits:
// dz_k = p_k (g_k - sum_a p_a g_a). In place; illegal entries become 0.
template <class Scalar>
void SoftmaxGradient(const Categorical<Scalar>& p, MatrixX<Scalar>* gradient);

}  // namespace dbr
