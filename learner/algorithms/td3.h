// Twin Delayed Deep Deterministic policy gradient over continuous actions (Fujimoto, van Hoof, Meger 2018,
// "Addressing Function Approximation Error in Actor-Critic Methods"), and the two algorithms for offline data
// that add a pull to the data's actions: TD3+BC (Fujimoto, Gu 2021, "A Minimalist Approach to Offline
// Reinforcement Learning") and ReBRAC (Tarasov et al. 2023, "Revisiting the Minimalist Approach to Offline
// Reinforcement Learning").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/td3_terms.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/deterministic_policy.h"
#include "learner/training/actor_critic.h"
#include "nn/gaussian_head.h"

namespace dbr {

// State: a deterministic policy pi(s) = tanh(mean(s)) with a target pi', and twin critics with targets. The
// policy is the Gaussian network that actors and files know, with its log-stds fixed at the lower limit: a
// sample differs from its mode by a deviation of e^-20. One thread at a time. One update (algorithm 1) on a
// batch B drawn uniformly from D:
//   1. y = r + discount * min_i Q'_i(s', a'), a' = clip(pi'(s') + noise, +-1). The noise is normal with
//      deviation target_noise, clipped to +-target_noise_limit. Each critic regresses on y. ReBRAC subtracts
//      critic_penalty * |a' - b'|^2 from min_i Q'_i, where b' is the data's next action.
//   2. Every policy_delay updates, pi minimises -E[Q_1(s, pi(s))], and the critics and pi are Polyak
//      averaged. TD3+BC minimises -q_weight E[Q_1] / E|Q_1| + E[|pi(s) - a|^2] / dimensions over the data's
//      actions a, ReBRAC -E[Q_1] / E|Q_1| + policy_penalty * E[|pi(s) - a|^2].
//   3. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin before its step, and V is the
//      smaller twin at pi(s) before step 2's step.
// Departures from the papers: of policy_delay updates the first one moves the policy, not the last. The
// actors add the exploration noise (actor.mode MODE with actor.action_noise). ReBRAC's code takes the smaller
// twin in step 2. Its deeper critics, larger batches and layer norm are settings of network and algorithm
// here.
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

  // Whether this update moves the policy and the targets.
  bool ImprovesPolicy() const { return networks_.updates % terms_.policy_delay == 0; }
  Scalar FitCritics(const BasicBatch<Scalar>& batch);
  // Makes steps 2 and 3. Returns the policy's loss, also in an update that does not move the policy.
  Scalar ImprovePolicy(const BasicBatch<Scalar>& batch);

  const Td3Terms terms_;
  GaussianHead<Scalar> pi_, next_pi_;
  DeterministicPolicyObjective<Scalar> objective_;
  CriticRegression<Scalar> regression_;
  // noise_ and next_actions_ [dimensions x n], next_inputs_ [observation + dimensions x n], d_output_
  // [2 * dimensions x n].
  MatrixX<Scalar> noise_, next_actions_, next_inputs_, d_output_;
  VectorX<Scalar> next_value_, value_;  // [n]
};

// Makes the one that spec.config names: td3, td3_bc or rebrac.
std::unique_ptr<Algorithm> MakeTd3(const AlgorithmSpec& spec);

}  // namespace dbr
