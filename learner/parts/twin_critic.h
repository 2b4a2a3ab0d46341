// Two critics with Polyak targets over discrete actions, each on a thread of its own where the runner has
// two.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "learner/parts/discrete_losses.h"
#include "learner/parts/pair_runner.h"
#include "learner/parts/trained_network.h"

namespace dbr {

// One thread at a time.
template <class Scalar>
class TwinCritic {
 public:
  // `runner` outlives the critics.
  TwinCritic(const MlpShape& shape, double learning_rate, Rng& rng, PairRunner* runner)
      : runner_(runner),
        first_{TrainedNetwork<Scalar>(shape, learning_rate, /*with_target=*/true, rng), {}, {}, 0},
        second_{TrainedNetwork<Scalar>(shape, learning_rate, /*with_target=*/true, rng), {}, {}, 0} {}

  // [n] V'(s') of the targets under `policy` (of the next states).
  void TargetValue(const ConstMatrixRef<Scalar>& next_observations, const Categorical<Scalar>& policy,
                   Scalar min_weight, VectorX<Scalar>* value) {
    const MatrixX<Scalar>*q1 = nullptr, *q2 = nullptr;
    runner_->Run([&] { q1 = &first_.network.ForwardTarget(next_observations); },
                 [&] { q2 = &second_.network.ForwardTarget(next_observations); });
    ExpectedTargetValue<Scalar>(policy, *q1, *q2, min_weight, value);
  }

  // Regresses both on y [n]; keeps the values from before the step in q1(), q2() [actions x n]. The two
  // losses' mean.
  Scalar Fit(const ConstMatrixRef<Scalar>& observations, const ConstMatrixRef<Scalar>& actions,
             const VectorX<Scalar>& y) {
    runner_->Run([&] { FitOne(observations, actions, y, &first_); },
                 [&] { FitOne(observations, actions, y, &second_); });
    return (first_.loss + second_.loss) / 2;
  }
  const MatrixX<Scalar>& q1() const { return first_.q; }
  const MatrixX<Scalar>& q2() const { return second_.q; }

  void set_learning_rate(double learning_rate) {
    first_.network.set_learning_rate(learning_rate);
    second_.network.set_learning_rate(learning_rate);
  }
  void UpdateTargets(double tau) {
    first_.network.UpdateTarget(tau);
    second_.network.UpdateTarget(tau);
  }
  const TrainedNetwork<Scalar>& first() const { return first_.network; }
  const TrainedNetwork<Scalar>& second() const { return second_.network; }

  void Save(TensorFile* file) const {
    first_.network.Save(kCritic1, file);
    second_.network.Save(kCritic2, file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = first_.network.Load(kCritic1, file);
    status.Update(second_.network.Load(kCritic2, file));
    return status;
  }

  // Useful operations of TargetValue and Fit on n samples.
  double Flops(Eigen::Index n) const {
    return 2 * (2 * first().shape().ForwardFlops(n) + first().shape().ParameterGradientFlops(n));
  }

 private:
  struct Critic {
    TrainedNetwork<Scalar> network;
    MatrixX<Scalar> q;    // of the newest Fit, before its step: [actions x n]
    MatrixX<Scalar> d_q;  // [actions x n]
    Scalar loss;
  };

  static void FitOne(const ConstMatrixRef<Scalar>& observations, const ConstMatrixRef<Scalar>& actions,
                     const VectorX<Scalar>& y, Critic* critic) {
    critic->q = critic->network.Forward(observations);
    critic->loss = CriticLoss<Scalar>(critic->q, actions, y, &critic->d_q);
    critic->network.Step(observations, critic->d_q);
  }

  PairRunner* const runner_;
  Critic first_, second_;
};

}  // namespace dbr
