// The losses over continuous actions, as pure functions with hand-written gradients (docs/algorithms.md maps
// them to their sources). The critics' values are [1 x n], or [1 x count * n] for `count` draws of each
// state. Draw k of state j is column k * n + j.
#pragma once

#include "core/batch.h"
#include "nn/gaussian_head.h"
#include "nn/mlp.h"
#include "proto/config.pb.h"

namespace dbr {

// Returns the mean of (q - y)^2 over the n values. Sets `d_q` [1 x n] to its gradient with respect to q
// [1 x n]. y [n] is a constant.
template <class Scalar>
Scalar SquaredError(const ConstMatrixRef<Scalar>& q, const VectorX<Scalar>& y, MatrixX<Scalar>* d_q);

// The price of a draw's log-probability in a value: value - temperature * log pi(a|s).
template <class Scalar>
struct SoftValue {
  Scalar temperature = 0;
  const VectorX<Scalar>& log_prob;  // [count * n]
};

// Sets `value` [n] to V'(s'): the greatest value, over a state's draws, of min_weight * min_i Q'_i + (1 -
// min_weight) * max_i Q'_i (Kumar et al. 2019, algorithm 1), less `soft`'s price where it is not null.
// Requires that `value` has its size n.
template <class Scalar>
void GreatestTargetValue(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                         Scalar min_weight, VectorX<Scalar>* value, const SoftValue<Scalar>* soft = nullptr);

// Sets `value` [n] to the mean over a state's draws of the smaller twin. Requires that `value` has its size
// n.
template <class Scalar>
void MeanOfSmaller(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                   VectorX<Scalar>* value);

// The Q term of a policy's loss: its value, and its gradients with respect to the twins' values.
template <class Scalar>
struct QTerm {
  Scalar loss = 0;
  Scalar value = 0;            // E[min_i mean_k Q_i(s, a_k)], not scaled
  Scalar scale = 1;            // what the values are divided by
  MatrixX<Scalar> d_q1, d_q2;  // [1 x count * n]
};

// loss = -E[min_i mean_k Q_i(s, a_k)] / scale. With `normalize`, scale is the mean over the batch of |min_i
// mean_k Q_i|, at least 1e-6, and counts as a constant. Without it, scale is 1. With use_q false the loss and
// its gradients are 0. With one draw for each state this is the Q term of SAC (Haarnoja et al. 2018, equation
// 7).
struct QTermOptions {
  bool use_q = true;
  bool normalize = false;
};
template <class Scalar>
void SmallerMeanQTerm(const QTermOptions& options, const ConstMatrixRef<Scalar>& q1,
                      const ConstMatrixRef<Scalar>& q2, Eigen::Index n, QTerm<Scalar>* term);

}  // namespace dbr
