// The critics with their Polyak targets, of which each update asks two. Where the runner has two threads,
// each takes half of the critics.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/policy_snapshot.h"
#include "learner/training/pair_runner.h"
#include "learner/training/trained_network.h"

namespace dbr {

// How many critics there are, and how many of them an update asks for a value (AlgorithmConfig.critics and
// target_critics).
struct CriticCounts {
  int critics = 2;
  int asked = 2;  // 1 or 2
};

// Owns the critics. A critic's output is [outputs x n]: a value for each action, or one value where the
// action is part of the input x [input x n]. An update asks two of them, "the twins", for all its values and
// trains all: the first two, or a pair that ChooseTwins draws (Chen et al. 2021). With asked = 1 both twins
// are the same critic. One thread at a time.
template <class Scalar>
class CriticEnsemble {
 public:
  // `options` asks for targets. `runner` must outlive the critics.
  CriticEnsemble(const MlpShape& shape, const TrainingOptions& options, Rng& rng, PairRunner* runner,
                 const CriticCounts& counts = {})
      : runner_(runner), asked_(static_cast<std::size_t>(counts.asked)) {
    critics_.reserve(static_cast<std::size_t>(counts.critics));
    for (int i = 0; i < counts.critics; ++i) {
      critics_.push_back({TrainedNetwork<Scalar>(shape, options, rng), {}, {}, {}, 0});
    }
    second_ = asked_ - 1;
  }

  // Draws the twins of an update, where there is a choice. Values that were asked for before are then of no
  // use.
  void ChooseTwins(Rng& rng) {
    if (critics_.size() == asked_) return;
    const auto count = static_cast<std::uint32_t>(critics_.size());
    first_ = rng.Below(count);
    second_ = first_;
    if (asked_ == 1) return;
    second_ = rng.Below(count - 1);
    if (second_ >= first_) ++second_;
  }

  // Evaluates the twins' targets. Their values are target1() and target2() until the next call.
  void EvaluateTargets(const ConstMatrixRef<Scalar>& x) {
    ForTwins([&](Critic* critic) { critic->target = &critic->network.ForwardTarget(x); });
  }
  const MatrixX<Scalar>& target1() const { return *critics_[first_].target; }
  const MatrixX<Scalar>& target2() const { return *critics_[second_].target; }

  // Makes one step of all critics, and of their targets, on loss(q, &d_q). `loss` returns a critic's loss and
  // sets its gradient with respect to q [outputs x n]; it may run on two threads at once. q1() and q2() are
  // the twins' values from before the step. Returns the mean of the critics' losses.
  template <class Loss>
  Scalar Fit(const ConstMatrixRef<Scalar>& x, const Loss& loss) {
    const auto fit = [&](std::size_t first) {
      for (std::size_t i = first; i < critics_.size(); i += 2) {
        Critic& critic = critics_[i];
        critic.q = critic.network.Forward(x);
        critic.loss = loss(critic.q, &critic.d_q);
        critic.network.Step(x, critic.d_q);
      }
    };
    runner_->Run([&] { fit(0); }, [&] { fit(1); });
    Scalar sum = 0;
    for (const Critic& critic : critics_) sum += critic.loss;
    return sum / static_cast<Scalar>(critics_.size());
  }
  const MatrixX<Scalar>& q1() const { return critics_[first_].q; }
  const MatrixX<Scalar>& q2() const { return critics_[second_].q; }

  // Evaluates the online twins. Their values are value1() and value2() until the next call.
  void Evaluate(const ConstMatrixRef<Scalar>& x) {
    ForTwins([&](Critic* critic) { critic->value = &critic->network.ForwardForInput(x); });
  }
  const MatrixX<Scalar>& value1() const { return *critics_[first_].value; }
  const MatrixX<Scalar>& value2() const { return *critics_[second_].value; }
  // Returns the gradient of sum(d_q1 .* q1 + d_q2 .* q2) with respect to the last rows of the newest
  // Evaluate's x, [rows x n]: to the actions, which stand below the observations.
  const MatrixX<Scalar>& InputGradient(const ConstMatrixRef<Scalar>& d_q1, const ConstMatrixRef<Scalar>& d_q2,
                                       Eigen::Index rows) {
    Critic &first = critics_[first_], &second = critics_[second_];
    if (&first == &second) {
      d_sum_ = d_q1 + d_q2;
      return FirstInputGradient(d_sum_, rows);
    }
    runner_->Run([&] { first.network.InputGradient(d_q1, rows, &first.d_x); },
                 [&] { second.network.InputGradient(d_q2, rows, &second.d_x); });
    first.d_x += second.d_x;
    return first.d_x;
  }
  // Returns the gradient of sum(d_q1 .* q1) alone.
  const MatrixX<Scalar>& FirstInputGradient(const ConstMatrixRef<Scalar>& d_q1, Eigen::Index rows) {
    Critic& first = critics_[first_];
    first.network.InputGradient(d_q1, rows, &first.d_x);
    return first.d_x;
  }

  void set_learning_rate(double learning_rate) {
    for (Critic& critic : critics_) critic.network.set_learning_rate(learning_rate);
  }
  // The tau of the targets' Polyak averaging in the next steps.
  void set_target_tau(double tau) {
    for (Critic& critic : critics_) critic.network.set_target_tau(tau);
  }

  // The two critics that actors get: the first one twice where there is no other.
  const TrainedNetwork<Scalar>& first() const { return critics_.front().network; }
  const TrainedNetwork<Scalar>& second() const { return critics_[std::min<std::size_t>(1, last())].network; }

  void Save(TensorFile* file) const {
    for (std::size_t i = 0; i < critics_.size(); ++i) critics_[i].network.Save(NameOf(i), file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status;
    for (std::size_t i = 0; i < critics_.size(); ++i) {
      status.Update(critics_[i].network.Load(NameOf(i), file));
    }
    return status;
  }

  // Useful floating-point operations for n samples. TargetFlops counts EvaluateTargets or Evaluate.
  double TargetFlops(Eigen::Index n) const { return static_cast<double>(asked_) * shape().ForwardFlops(n); }
  double FitFlops(Eigen::Index n) const {
    return static_cast<double>(critics_.size()) *
           (shape().ForwardFlops(n) + shape().ParameterGradientFlops(n));
  }
  // The operations of Evaluate and InputGradient, where each sample's gradient goes through one of the twins.
  double InputGradientFlops(Eigen::Index n) const { return TargetFlops(n) + shape().ForwardFlops(n); }
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

  // The name of a critic's tensors: critic_1, critic_2, ...
  static std::string NameOf(std::size_t i) { return absl::StrCat("critic_", i + 1); }

  template <class Function>
  void ForTwins(const Function& function) {
    runner_->Run([&] { function(&critics_[first_]); },
                 [&] {
                   if (second_ != first_) function(&critics_[second_]);
                 });
  }
  std::size_t last() const { return critics_.size() - 1; }
  const MlpShape& shape() const { return first().shape(); }

  PairRunner* const runner_;
  const std::size_t asked_;
  std::vector<Critic> critics_;
  std::size_t first_ = 0, second_ = 0;  // the twins
  MatrixX<Scalar> d_sum_;               // [outputs x n]
};

}  // namespace dbr
