// Calibrated Q-Learning over continuous actions (Nakamoto et al. 2023, "Cal-QL: Calibrated Offline RL
// Pre-Training for Efficient Online Fine-Tuning"), on conservative Q-learning (Kumar et al. 2020,
// "Conservative Q-Learning for Offline Reinforcement Learning").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/soft_networks.h"
#include "learner/objectives/conservative_regression.h"
#include "learner/objectives/sampled_actions.h"
#include "learner/objectives/soft_policy_objective.h"
#include "nn/gaussian_head.h"

namespace dbr {

// State: a policy pi, twin critics with targets and a temperature. One thread at a time. One update on a
// batch B drawn uniformly from D:
//   1. y = r + discount * min_i Q'_i(s', a'), where a' is drawn from pi.
//   2. Each critic regresses on y, and is pushed down at conservative_actions draws of each of three sources
//      (uniform, pi at s, pi at s', all evaluated at s) and up at the data's action
//      (learner/objectives/conservative_regression.h). Calibrated, its values at pi's draws count as at least
//      the data's return R: a critic is not pushed below the value of the policy that made the data.
//   3. pi and the temperature are trained as SAC's (learner/algorithms/sac.h, steps 2 and 3).
//   4. Polyak averaging of the critics, and of pi: evaluations play the average.
//   5. A = Q(s, a) - V(s) for every transition of B, as SAC's.
// As in the authors' code, step 1 has no entropy. Departure: online and offline the conservative term has the
// same weight.
template <class Scalar>
class CalQl : public ActorCriticAlgorithm<SoftNetworks<Scalar>> {
 public:
  explicit CalQl(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used. `uniform` carries returns.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;

 private:
  using Base = ActorCriticAlgorithm<SoftNetworks<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const CalQlConfig& config() const { return networks_.spec.config.cal_ql(); }
  // Evaluates the policy at s' and at s.
  void EvaluatePolicy(const BasicBatch<Scalar>& batch);
  // Fills conservative_.
  void DrawActions(Eigen::Index n);
  Scalar FitCritics(const BasicBatch<Scalar>& batch);
  SoftPolicyLoss<Scalar> ImprovePolicy(const BasicBatch<Scalar>& batch);

  Scalar target_entropy_;  // nats

  GaussianHead<Scalar> head_, next_head_;  // pi at s, pi at s'
  SampledActions<Scalar> next_draws_, conservative_draws_;
  ConservativeDraws<Scalar> conservative_;
  ConservativeRegression<Scalar> regression_;
  SoftPolicyObjective<Scalar> objective_;
  // [dimensions x n], [dimensions x conservative_actions * n], [2 * dimensions x n]
  MatrixX<Scalar> noise_, conservative_noise_, d_output_;
  VectorX<Scalar> next_value_, value_;  // [n]
};

std::unique_ptr<Algorithm> MakeCalQl(const AlgorithmSpec& spec);

}  // namespace dbr
