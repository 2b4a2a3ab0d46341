// Advantage Weighted Actor Critic over continuous actions (Nair, Gupta, Dalal, Levine 2020, "AWAC:
// Accelerating Online Reinforcement Learning with Offline Datasets").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/gaussian_likelihood.h"
#include "learner/objectives/sampled_actions.h"
#include "learner/training/actor_critic.h"

namespace dbr {

// State: a policy pi and twin critics with targets. One thread at a time. One update (algorithm 1) on a batch
// B drawn uniformly from D:
//   1. A = min_i Q_i(s, a) - mean_k min_i Q_i(s, a_k) for every transition, where the a_k are value_samples
//      draws from pi.
//   2. y = r + discount * min_i Q'_i(s', a'), where a' is one draw from pi. Each critic regresses on y.
//   3. pi maximises E[w log pi(a|s)] over B. The weight w = min(exp(A / temperature), max_weight) is a
//      constant.
//   4. Polyak averaging of the critics, and of pi: evaluations play the average.
// Departures from the paper: A is taken before the critics' step. One forward pass at (s, a) then serves
// both, and both sides of A come from the same critics. pi is a tanh-Gaussian, where theirs is a Gaussian.
// While pi is trained, its log-std is clipped to [-5, 2], the limits of the behaviour policies: with the
// policies' own lower limit of -20 the likelihood of data from a deterministic policy has no useful bound.
// Actors clip at -20, so pi may sample more narrowly than e^-5 there, but never more broadly.
template <class Scalar>
class Awac : public ActorCriticAlgorithm<ActorCritic<Scalar>> {
 public:
  explicit Awac(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;

 private:
  using Base = ActorCriticAlgorithm<ActorCritic<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const AwacConfig& config() const { return networks_.spec.config.awac(); }
  // Writes V(s) [n] into value_, estimated by draws from pi at s.
  void ComputeValue(const BasicBatch<Scalar>& batch);
  Scalar FitCritics(const BasicBatch<Scalar>& batch);

  GaussianLikelihood<Scalar> pi_{kBehaviorLogStd};
  GaussianHead<Scalar> next_pi_;
  SampledActions<Scalar> draws_, next_draws_;
  CriticRegression<Scalar> regression_;
  MatrixX<Scalar> noise_, next_noise_;  // [dimensions x value_samples * n], [dimensions x n]
  VectorX<Scalar> value_, next_value_, advantage_, weights_;  // [n]
};

std::unique_ptr<Algorithm> MakeAwac(const AlgorithmSpec& spec);

}  // namespace dbr
