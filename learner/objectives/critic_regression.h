// The step of the critics that all algorithms over continuous actions share.
#pragma once

#include "core/batch.h"
#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/critic_target.h"
#include "learner/training/critic_ensemble.h"

namespace dbr {

// Fits the critics, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class CriticRegression {
 public:
  // Makes one step of both critics on the mean of (Q_i(s, a) - y)^2, where y = reward_scale * r + discount *
  // V'(s') is a constant. next_value [n] is V'(s'). With `bonus` [n] the rewards are r + bonus. Returns the
  // mean of the two losses. The batch must not be empty.
  Scalar Fit(const BasicBatch<Scalar>& batch, double reward_scale, const VectorX<Scalar>& next_value,
             CriticEnsemble<Scalar>* critics, const VectorX<Scalar>* bonus = nullptr) {
    CriticTarget(batch, reward_scale, next_value, &target_);
    if (bonus != nullptr) target_ += static_cast<Scalar>(reward_scale) * *bonus;
    inputs_.resize(batch.observations.rows() + batch.actions.rows(), batch.size());
    inputs_ << batch.observations, batch.actions;
    const Scalar loss = critics->Fit(inputs_, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
      return SquaredError<Scalar>(q, target_, d_q);
    });
    behavior_value_.resize(batch.size());
    MeanOfSmaller<Scalar>(critics->q1(), critics->q2(), &behavior_value_);
    return loss;
  }

  const VectorX<Scalar>& target() const { return target_; }  // [n] y
  // [n] The smaller twin at the batch's actions, from before the step.
  const VectorX<Scalar>& behavior_value() const { return behavior_value_; }

 private:
  VectorX<Scalar> target_, behavior_value_;  // [n]
  MatrixX<Scalar> inputs_;                   // [observation + dimensions x n]
};

}  // namespace dbr
