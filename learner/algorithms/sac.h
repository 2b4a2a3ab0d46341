// Soft Actor-Critic over continuous actions (Haarnoja et al. 2018, "Soft Actor-Critic Algorithms and
// Applications").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/soft_networks.h"
#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/sampled_actions.h"
#include "learner/objectives/soft_policy_objective.h"
#include "nn/gaussian_head.h"

namespace dbr {

// State: a policy pi, twin critics with targets and a temperature. One thread at a time. One update on a
// batch B drawn uniformly from D:
//   1. y = r + discount * (min_i Q'_i(s', a') - temperature * log pi(a'|s')), where a' is drawn from pi
//      (equations 3 and 5). Each critic regresses on y.
//   2. pi minimises E[temperature * log pi(a|s) - min_i Q_i(s, a)], where a is drawn from pi and the gradient
//      flows through the draw (equation 9).
//   3. The temperature rises where the entropy is below its target and falls above it (equation 18).
//      Steps 2 and 3 are made in every updates_per_policy_update-th update.
//   4. Polyak averaging of the critics, and of pi: evaluations play the average.
//   5. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin before its step, and V is the
//      smaller twin at an action drawn as in step 2.
template <class Scalar>
class Sac : public ActorCriticAlgorithm<SoftNetworks<Scalar>> {
 public:
  explicit Sac(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;

 private:
  using Base = ActorCriticAlgorithm<SoftNetworks<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  // Evaluates the policy at s' and at s.
  void EvaluatePolicy(const BasicBatch<Scalar>& batch);
  Scalar FitCritics(const BasicBatch<Scalar>& batch);
  // Makes a step of the policy where `improves`, and sets value_.
  void ImprovePolicy(const BasicBatch<Scalar>& batch, bool improves);

  Scalar target_entropy_;               // nats
  SoftPolicyLoss<Scalar> policy_loss_;  // of the newest update that improved the policy

  GaussianHead<Scalar> head_, next_head_;  // pi at s, pi at s'
  SampledActions<Scalar> next_draws_;
  SoftPolicyObjective<Scalar> objective_;
  CriticRegression<Scalar> regression_;
  MatrixX<Scalar> noise_, d_output_;    // [dimensions x n], [2 * dimensions x n]
  VectorX<Scalar> next_value_, value_;  // [n]
};

std::unique_ptr<Algorithm> MakeSac(const AlgorithmSpec& spec);

}  // namespace dbr
