// Twin Delayed Deep Deterministic policy gradient over continuous actions (Fujimoto, van Hoof, Meger 2018,
// "Addressing Function Approximation Error in Actor-Critic Methods").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/deterministic_policy.h"
#include "learner/training/actor_critic.h"
#include "nn/gaussian_head.h"

namespace dbr {

// State: a deterministic policy pi(s) = tanh(mean(s)) with a target pi', and twin critics with targets. The
// policy is the Gaussian network that actors and files know, with its log-stds fixed at the lower limit: a
// sample differs from its mode by a deviation of e^-20. One thread at a time. One update (algorithm 1) on a
// batch B drawn uniformly from D:
//   1. y = r + discount * min_i Q'_i(s', clip(pi'(s') + noise, +-1)). The noise is normal with deviation
//      target_noise, clipped to +-target_noise_limit. Each critic regresses on y.
//   2. Every policy_delay updates, pi minimises -E[Q_1(s, pi(s))], and the critics and pi are Polyak
//      averaged.
//   3. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin before its step, and V is the
//      smaller twin at pi(s) before step 2's step.
// Departures from the paper: of policy_delay updates the first one moves the policy, not the last. The actors
// add the exploration noise (actor.mode MODE with actor.action_noise).
template <class Scalar>
class Td3 : public ActorCriticAlgorithm<ActorCritic<Scalar>> {
 public:
  explicit Td3(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;  // the mean over policy_delay updates

 private:
  using Base = ActorCriticAlgorithm<ActorCritic<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const Td3Config& config() const { return networks_.spec.config.td3(); }
  // Whether this update moves the policy and the targets.
  bool ImprovesPolicy() const { return networks_.updates % config().policy_delay() == 0; }
  Scalar FitCritics(const BasicBatch<Scalar>& batch);
  // Makes steps 2 and 3. Returns the policy's loss, also in an update that does not move the policy.
  Scalar ImprovePolicy(const BasicBatch<Scalar>& batch);

  GaussianHead<Scalar> pi_, next_pi_;
  DeterministicPolicyObjective<Scalar> objective_;
  CriticRegression<Scalar> regression_;
  // noise_ and next_actions_ [dimensions x n], next_inputs_ [observation + dimensions x n], d_output_
  // [2 * dimensions x n].
  MatrixX<Scalar> noise_, next_actions_, next_inputs_, d_output_;
  VectorX<Scalar> next_value_, value_;  // [n]
};

std::unique_ptr<Algorithm> MakeTd3(const AlgorithmSpec& spec);

}  // namespace dbr
