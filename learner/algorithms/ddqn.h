// Double DQN over discrete actions (van Hasselt, Guez, Silver 2016, "Deep Reinforcement Learning with Double
// Q-learning").
#pragma once

#include <memory>
#include <vector>

#include "core/rng.h"
#include "learner/algorithm.h"
#include "learner/training/trained_network.h"

namespace dbr {

// State: one network Q [actions] with a target Q'. One thread at a time. One update on a batch B drawn
// uniformly from D:
//   1. y = r + discount * Q'(s', argmax_a Q(s', a)), where a runs over the legal actions of s' (equation 4).
//      Q regresses on y by the mean squared error.
//   2. Polyak averaging of the target.
//   3. A = Q(s, a) - max_a Q(s, a) for every transition of B, with Q from before its step and the maximum
//      over the legal actions.
// Departures from the paper: the target moves by Polyak averaging, not by a copy after a fixed number of
// updates. The optimizer is Adam. Errors are not clipped. The actors explore (docs/operations.md).
// The network is exported as the policy: the mode MODE plays the greatest Q, and SAMPLE draws from a softmax
// of Q. It is exported again as each of the two critics, so that GREEDY_Q and `dbr probe` can read Q. An
// actor's first advantage is therefore Q(s, a) minus the mean of Q under that softmax. The learner's
// advantage replaces it later.
template <class Scalar>
class Ddqn {
 public:
  explicit Ddqn(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  BatchNeeds needs() const { return {.uniform = static_cast<int>(spec_.config.batch_size())}; }
  const std::vector<float>& advantages() const { return advantages_; }
  const std::vector<UpdateMetric>& metrics() const { return metrics_; }
  double UpdateFlops() const;
  void ExportPolicy(PolicySnapshot* snapshot) const;
  void Save(TensorFile* file) const;
  absl::Status Load(const TensorFile& file);

 private:
  void ComputeTarget(const BasicBatch<Scalar>& batch);

  AlgorithmSpec spec_;
  Rng init_rng_;
  TrainedNetwork<Scalar> network_;
  std::uint64_t updates_ = 0;

  MatrixX<Scalar> next_q_, d_q_;                 // [actions x n]
  VectorX<Scalar> next_value_, target_, value_;  // [n]
  std::vector<float> advantages_;
  std::vector<UpdateMetric> metrics_;
};

std::unique_ptr<Algorithm> MakeDdqn(const AlgorithmSpec& spec);

}  // namespace dbr
