// The step of the twin critics over continuous actions, which all algorithms there have in common.
#pragma once

#include "core/batch.h"
#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/critic_target.h"
#include "learner/training/twin_critic.h"

namespace dbr {

// Workspaces, reused from batch to batch.
template <class Scalar>
class CriticRegression {
 public:
  // One step of both critics on the mean of (Q_i(s, a) - y)^2, y = reward_scale * r + discount * V'(s') a
  // constant. next_value [n] is V'(s'). With `bonus` [n] the rewards are r + bonus. Gives the two losses'
  // mean.
  Scalar Fit(const BasicBatch<Scalar>& batch, double reward_scale, const VectorX<Scalar>& next_value,
             TwinCritic<Scalar>* critics, const VectorX<Scalar>* bonus = nullptr) {
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
  // [n] the smaller twin at the batch's actions, from before the step.
  const VectorX<Scalar>& behavior_value() const { return behavior_value_; }

 private:
  VectorX<Scalar> target_, behavior_value_;
  MatrixX<Scalar> inputs_;  // [observation + dimensions x n]
};

}  // namespace dbr
