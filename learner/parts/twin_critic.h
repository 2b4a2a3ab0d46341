// Two critics with Polyak targets over discrete actions.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "learner/parts/discrete_losses.h"
#include "learner/parts/trained_network.h"

namespace dbr {

// One thread at a time.
template <class Scalar>
class TwinCritic {
 public:
  TwinCritic(const MlpShape& shape, double learning_rate, Rng& rng)
      : first_(shape, learning_rate, /*with_target=*/true, rng),
        second_(shape, learning_rate, /*with_target=*/true, rng) {}

  // [n] V'(s') of the targets under `policy` (of the next states).
  void TargetValue(const ConstMatrixRef<Scalar>& next_observations, const Categorical<Scalar>& policy,
                   Scalar min_weight, VectorX<Scalar>* value) {
    ExpectedTargetValue<Scalar>(policy, first_.ForwardTarget(next_observations),
                                second_.ForwardTarget(next_observations), min_weight, value);
  }

  // Regresses both on y [n]; keeps the values from before the step in q1(), q2() [actions x n]. The two losses' mean.
  Scalar Fit(const ConstMatrixRef<Scalar>& observations, const ConstMatrixRef<Scalar>& actions,
             const VectorX<Scalar>& y) {
    const Scalar loss1 = FitOne(observations, actions, y, &first_, &q1_);
    const Scalar loss2 = FitOne(observations, actions, y, &second_, &q2_);
    return (loss1 + loss2) / 2;
  }
  const MatrixX<Scalar>& q1() const { return q1_; }
  const MatrixX<Scalar>& q2() const { return q2_; }

  void UpdateTargets(double tau) {
    first_.UpdateTarget(tau);
    second_.UpdateTarget(tau);
  }
  const TrainedNetwork<Scalar>& first() const { return first_; }
  const TrainedNetwork<Scalar>& second() const { return second_; }

  void Save(TensorFile* file) const {
    first_.Save(kCritic1, file);
    second_.Save(kCritic2, file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = first_.Load(kCritic1, file);
    status.Update(second_.Load(kCritic2, file));
    return status;
  }

  // Useful operations of TargetValue and Fit on n samples.
  double Flops(Eigen::Index n) const {
    return 2 * (2 * first_.shape().ForwardFlops(n) + first_.shape().ParameterGradientFlops(n));
  }

 private:
  Scalar FitOne(const ConstMatrixRef<Scalar>& observations, const ConstMatrixRef<Scalar>& actions,
                const VectorX<Scalar>& y, TrainedNetwork<Scalar>* critic, MatrixX<Scalar>* q) {
    *q = critic->Forward(observations);
    const Scalar loss = CriticLoss<Scalar>(*q, actions, y, &d_q_);
    critic->Step(observations, d_q_);
    return loss;
  }

  TrainedNetwork<Scalar> first_, second_;
  MatrixX<Scalar> q1_, q2_, d_q_;
};

}  // namespace dbr
