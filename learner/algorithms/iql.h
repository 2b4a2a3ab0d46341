// Implicit Q-Learning over continuous actions (Kostrikov, Nair, Levine 2021, "Offline Reinforcement Learning
// with Implicit Q-Learning").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/gaussian_likelihood.h"
#include "learner/training/actor_critic.h"

namespace dbr {

// State: a policy pi, twin critics with targets and a value V. One thread at a time. One update on a batch B
// drawn uniformly from D:
//   1. A = min_i Q'_i(s, a) - V(s) for every transition.
//   2. V minimises E[|expectile - 1(A < 0)| A^2] (equation 5).
//   3. y = r + discount * V(s'). Each critic regresses on y (equation 6).
//   4. pi maximises E[w log pi(a|s)] over B (equation 7). The weight w = min(exp(A / temperature),
//   max_weight)
//      is a constant.
//   5. Polyak averaging of the critics, and of pi: evaluations play the average.
// No action but the data's is ever evaluated. Departures from the paper: steps 3 and 4 take V from before
// step 2, so that nothing is computed twice. pi is a tanh-Gaussian whose log-std depends on the state and is
// clipped to [-5, 2] while it is trained, as AWAC's (learner/algorithms/awac.h).
template <class Scalar>
class Iql : public ActorCriticAlgorithm<ActorCritic<Scalar>> {
 public:
  explicit Iql(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;
  void Save(TensorFile* file) const;
  absl::Status Load(const TensorFile& file);

 private:
  using Base = ActorCriticAlgorithm<ActorCritic<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const IqlConfig& config() const { return networks_.spec.config.iql(); }
  // Sets target_value_, advantage_ and next_value_. Makes step 2 and returns its loss.
  Scalar FitValue(const BasicBatch<Scalar>& batch);

  TrainedNetwork<Scalar> value_;  // V [observation -> 1]

  GaussianLikelihood<Scalar> pi_{kBehaviorLogStd};
  CriticRegression<Scalar> regression_;
  MatrixX<Scalar> inputs_, d_value_;  // [observation + dimensions x n], [1 x n]
  VectorX<Scalar> target_value_, advantage_, next_value_, weights_;  // [n]; target_value_ is min_i Q'_i(s, a)
};

std::unique_ptr<Algorithm> MakeIql(const AlgorithmSpec& spec);

}  // namespace dbr
