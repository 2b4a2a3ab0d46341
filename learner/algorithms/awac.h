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

// State: policy pi, twin critics with targets. One update (algorithm 1) on a batch B drawn uniformly
// from D:
//   1. A = min_i Q_i(s, a) - mean_k min_i Q_i(s, a_k) of every transition, a_k value_samples draws of pi.
//   2. y = r + discount * min_i Q'_i(s', a'), a' one draw of pi; each critic regresses on y.
//   3. pi maximises E[w log pi(a|s)] over B, w = min(exp(A / temperature), max_weight) a constant.
//   4. Polyak averaging of the critics.
// Departures: A is taken before the critics' step, whose forward pass at (s, a) serves both, so that nothing
// is computed twice and both sides of A are of the same critics. pi is a tanh-Gaussian, where theirs is a
// Gaussian, and its log-std is clipped to the behaviour policies' [-5, 2] while it is trained: with the
// policies' own lower limit of -20 the likelihood of data from a deterministic policy has no useful bound.
// Actors clip at -20: at the bound pi may sample more narrowly than e^-5, never more broadly.
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
  // V(s) [n] into value_, by draws from pi at s.
  void ComputeValue(const BasicBatch<Scalar>& batch);
  Scalar FitCritics(const BasicBatch<Scalar>& batch);

  GaussianLikelihood<Scalar> pi_{kBehaviorLogStd};
  GaussianHead<Scalar> next_pi_;
  SampledActions<Scalar> draws_, next_draws_;
  CriticRegression<Scalar> regression_;
  MatrixX<Scalar> noise_, next_noise_;
  VectorX<Scalar> value_, next_value_, advantage_, weights_;
};

std::unique_ptr<Algorithm> MakeAwac(const AlgorithmSpec& spec);

}  // namespace dbr
