// Two critics with Polyak targets. Where the runner has two threads, each critic runs on one of them.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "core/policy_snapshot.h"
#include "learner/training/pair_runner.h"
#include "learner/training/trained_network.h"

namespace dbr {

// Owns both critics. A critic's output is [outputs x n]: a value for each action, or one value where the
// action is part of the input x [input x n]. One thread at a time.
template <class Scalar>
class TwinCritic {
 public:
  // `options` asks for targets. `runner` must outlive the critics.
  TwinCritic(const MlpShape& shape, const TrainingOptions& options, Rng& rng, PairRunner* runner)
      : runner_(runner),
        first_{TrainedNetwork<Scalar>(shape, options, rng), {}, {}, {}, 0},
        second_{TrainedNetwork<Scalar>(shape, options, rng), {}, {}, {}, 0} {}

  // Evaluates the targets. Their values are target1() and target2() until the next call.
  void EvaluateTargets(const ConstMatrixRef<Scalar>& x) {
    runner_->Run([&] { first_.target = &first_.network.ForwardTarget(x); },
                 [&] { second_.target = &second_.network.ForwardTarget(x); });
  }
  const MatrixX<Scalar>& target1() const { return *first_.target; }
  const MatrixX<Scalar>& target2() const { return *second_.target; }

  // Makes one step of both critics, and of their targets, on loss(q, &d_q). `loss` returns a critic's loss
  // and sets its gradient with respect to q [outputs x n]; it may run on two threads at once. q1() and q2()
  // keep the values from before the step. Returns the mean of the two losses.
  template <class Loss>
  Scalar Fit(const ConstMatrixRef<Scalar>& x, const Loss& loss) {
    const auto fit = [&](Critic* critic) {
      critic->q = critic->network.Forward(x);
      critic->loss = loss(critic->q, &critic->d_q);
      critic->network.Step(x, critic->d_q);
    };
    runner_->Run([&] { fit(&first_); }, [&] { fit(&second_); });
    return (first_.loss + second_.loss) / 2;
  }
  const MatrixX<Scalar>& q1() const { return first_.q; }
  const MatrixX<Scalar>& q2() const { return second_.q; }

  // Evaluates the online critics. Their values are value1() and value2() until the next call.
  void Evaluate(const ConstMatrixRef<Scalar>& x) {
    runner_->Run([&] { first_.value = &first_.network.ForwardForInput(x); },
                 [&] { second_.value = &second_.network.ForwardForInput(x); });
  }
  const MatrixX<Scalar>& value1() const { return *first_.value; }
  const MatrixX<Scalar>& value2() const { return *second_.value; }
  // Returns the gradient of sum(d_q1 .* q1 + d_q2 .* q2) with respect to the last rows of the newest
  // Evaluate's x, [rows x n]: to the actions, which stand below the observations.
  const MatrixX<Scalar>& InputGradient(const ConstMatrixRef<Scalar>& d_q1, const ConstMatrixRef<Scalar>& d_q2,
                                       Eigen::Index rows) {
    runner_->Run([&] { first_.network.InputGradient(d_q1, rows, &first_.d_x); },
                 [&] { second_.network.InputGradient(d_q2, rows, &second_.d_x); });
    first_.d_x += second_.d_x;
    return first_.d_x;
  }
  // Returns the gradient of sum(d_q1 .* q1) alone.
  const MatrixX<Scalar>& FirstInputGradient(const ConstMatrixRef<Scalar>& d_q1, Eigen::Index rows) {
    first_.network.InputGradient(d_q1, rows, &first_.d_x);
    return first_.d_x;
  }

  void set_learning_rate(double learning_rate) {
    first_.network.set_learning_rate(learning_rate);
    second_.network.set_learning_rate(learning_rate);
  }
  // The tau of the targets' Polyak averaging in the next steps.
  void set_target_tau(double tau) {
    first_.network.set_target_tau(tau);
    second_.network.set_target_tau(tau);
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

  // Useful floating-point operations for n samples. TargetFlops counts EvaluateTargets or Evaluate.
  double TargetFlops(Eigen::Index n) const { return 2 * shape().ForwardFlops(n); }
  double FitFlops(Eigen::Index n) const {
    return 2 * (shape().ForwardFlops(n) + shape().ParameterGradientFlops(n));
  }
  // The operations of Evaluate and InputGradient, where each sample's gradient goes through one of the two
  // critics.
  double InputGradientFlops(Eigen::Index n) const { return 3 * shape().ForwardFlops(n); }
  // The operations of FirstInputGradient, without Evaluate.
  double FirstInputGradientFlops(Eigen::Index n) const { return shape().ForwardFlops(n); }

 private:
  struct Critic {
    TrainedNetwork<Scalar> network;
    MatrixX<Scalar> q;    // [outputs x n], kept by the newest Fit from before its step
    MatrixX<Scalar> d_q;  // [outputs x n]
    MatrixX<Scalar> d_x;  // [rows x n], set by InputGradient
    Scalar loss;
    const MatrixX<Scalar>* target = nullptr;  // [outputs x n], set by EvaluateTargets
    const MatrixX<Scalar>* value = nullptr;   // [outputs x n], set by Evaluate
  };

  const MlpShape& shape() const { return first_.network.shape(); }

  PairRunner* const runner_;
  Critic first_, second_;
};

}  // namespace dbr
