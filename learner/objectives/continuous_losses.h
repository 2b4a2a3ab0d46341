// The losses over continuous actions as pure functions with hand-written gradients (docs/algorithms.md maps
// them to their sources). Critics' values are [1 x n], or [1 x count * n] for `count` draws of each state,
// draw k of state j in column k * n + j.
#pragma once

#include "core/batch.h"
#include "nn/gaussian_head.h"
#include "nn/mlp.h"
#include "proto/config.pb.h"

namespace dbr {

// The mean of (q - y)^2 and its gradient with respect to q [1 x n]; y [n] is a constant.
template <class Scalar>
Scalar SquaredError(const ConstMatrixRef<Scalar>& q, const VectorX<Scalar>& y, MatrixX<Scalar>* d_q);

// V'(s') [n]: the greatest over a state's draws of min_weight * min_i Q'_i + (1 - min_weight) * max_i Q'_i.
template <class Scalar>
void GreatestTargetValue(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                         Scalar min_weight, VectorX<Scalar>* value);

// [n] the mean over a state's draws of the smaller twin.
template <class Scalar>
void MeanOfSmaller(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                   VectorX<Scalar>* value);

// The Q term of a policy's loss: its value, and its gradients with respect to the twins' values.
template <class Scalar>
struct QTerm {
  Scalar loss = 0;
  Scalar value = 0;  // what the policy is worth
  MatrixX<Scalar> d_q1, d_q2;
};

// loss = -E[min_i mean_k Q_i(s, a_k)] / scale, scale the mean over the batch of |min_i mean_k Q_i| (a
// constant) where `normalize`, else 1. With use_q false the loss and its gradients are 0. With one draw of
// each state it is the Q term of SAC (Haarnoja et al. 2018, equation 7).
struct QTermOptions {
  bool use_q = true;
  bool normalize = false;
};
template <class Scalar>
void SmallerMeanQTerm(const QTermOptions& options, const ConstMatrixRef<Scalar>& q1,
                      const ConstMatrixRef<Scalar>& q2, Eigen::Index n, QTerm<Scalar>* term);

}  // namespace dbr
