// Dual Behavior Regularized reinforcement learning over continuous actions (Siu, Traish, Xu 2021).
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/dual_behavior_networks.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/dual_behavior_objective.h"
#include "learner/objectives/gaussian_likelihood.h"
#include "learner/objectives/greatest_target.h"
#include "learner/objectives/self_imitation.h"

namespace dbr {

// State: a policy pi with a target pi', twin critics with targets, the behaviour policies beta+ for D+ and
// beta- for D- (all three policies are tanh-Gaussian), and a multiplier alpha. One thread at a time. One
// update, with B drawn from D, B+ from D+ and B- from D-:
//   1. beta+ maximises the mean of log beta+(a|s) over B+, and beta- does the same over B- (the definitions
//      above the paper's equation 3). An empty part skips its step.
//   2. y = r + discount * V'(s'), where V' is the greatest value of w min_i Q'_i + (1 - w) max_i Q'_i - tau
//      log pi'(a'|s') over target_samples draws a' from pi', w = target_min_weight. With value_penalty, alpha
//      * D(pi'(.|s'), beta+(.|s')) is subtracted from V' (the paper's equation 3), times the mean of |V'|
//      where normalize_q divides Q by its mean size. Each critic regresses on y.
//   3. pi minimises -(E[min_i mean_k Q_i(s, a_k)] + tau H(pi)) + alpha * (D(pi, beta+) - c), the dynamic
//      constraint of the paper's section "From ARM and BEAR to DBR"
//      (learner/objectives/dual_behavior_objective.h).
//   4. alpha ascends on alpha * (D(pi, beta+) - c). The temperature tau rises while the entropy H(pi) is less
//      than target_entropy for each dimension and falls while it is more (Haarnoja et al. 2018, equation 18).
//      Without first_temperature tau is 0 in step 2 and entropy_weight in step 3.
//   5. Polyak averaging of the critics and of pi.
//   6. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin, and V is the mean of the smaller
//      twin over the draws of step 3.
//
// Advantage SIL (the paper's section "ARM and SIL"; Oh et al. 2018): step 6 takes A = reward_scale * R -
// V(s), where R is the Monte-Carlo return. beta+ is then fitted after step 6, in a step of its own, and to B
// instead of B+. It maximises the mean of w log beta+(a|s), where w = max(A, 0) divided by its mean over B.
// The step is skipped where all w are 0. The critics take no part in it.
// munchausen_weight w: the reward of step 2 becomes r + w * log beta+(a|s), with the log clipped to [-1, 0],
// before it is scaled (the paper's section on ablations). beta+ is the one that step 1 left.
// Constraint NONE: step 3 has no second term, and step 4 moves tau alone.
// behavior_data BATCH: in place of step 1, beta+ and beta- are fitted after step 6 to the transitions of B
// in D+ and in D- (BatchPartition).
// divergence ACTIONS: step 3 measures the distance of pi's mode to the actions of B itself, weighted by the
// advantages of step 6 (the returns' with advantage SIL), in place of D(pi, beta+) and D(pi, beta-).
// SetControls: alpha and tau are then the given ones and not learned, and target_entropy is the given one.
// updates_per_policy_update k: steps 3 and 4 are made in every k-th update. V(s) of step 6 is then the mean
// over draws of the same number.
//
// Departure from the paper: step 6 takes Q(s, a) from before step 2's gradient step, so that nothing is
// computed twice.
template <class Scalar>
class ContinuousDbr : public ActorCriticAlgorithm<DualBehaviorNetworks<Scalar>> {
 public:
  explicit ContinuousDbr(const AlgorithmSpec& spec);

  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;

 private:
  using Base = ActorCriticAlgorithm<DualBehaviorNetworks<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const DbrConfig& config() const { return networks_.config(); }
  void FitBehaviors(const BasicBatch<Scalar>& plus, const BasicBatch<Scalar>& minus);
  // Evaluates pi' at s' and pi at s.
  void EvaluatePolicy(const BasicBatch<Scalar>& batch);
  // Writes V'(s') [n] into next_value_. EvaluatePolicy comes first.
  void ComputeNextValue(const BasicBatch<Scalar>& batch);
  // Evaluates beta+ at the states of the batch, and beta- where it can move the threshold.
  void EvaluateBehaviors(const BasicBatch<Scalar>& batch);
  // Returns the bonus that is added to the rewards [n], or null for none. EvaluateBehaviors comes first.
  const VectorX<Scalar>* RewardBonus(const BasicBatch<Scalar>& batch);
  // Makes a step of pi, where this update improves it, and sets value_.
  void ImprovePolicy(const BasicBatch<Scalar>& batch);
  // Sets the advantages and makes the fits that need them. ImprovePolicy comes first.
  void JudgeAndImitate(const BasicBatch<Scalar>& batch);
  void DrawDivergenceNoise(Eigen::Index n);

  PolicyLossOptions options_;

  GaussianLikelihood<Scalar> beta_plus_{kBehaviorLogStd}, beta_minus_{kBehaviorLogStd};
  CriticRegression<Scalar> regression_;
  GaussianHead<Scalar> pi_;
  GreatestTarget<Scalar> next_;
  DualBehaviorObjective<Scalar> objective_;
  GaussianDivergence<Scalar> penalty_;
  ObjectiveNoise<Scalar> noise_;
  MatrixX<Scalar> next_noise_, d_output_;  // [dimensions x target_samples * n], [2 * dimensions x n]
  VectorX<Scalar> next_value_, value_, log_prob_, bonus_, earned_;  // [n]
  GaussianGradient<Scalar> unused_gradient_;                        // the workspace of a likelihood
  SelfImitation<Scalar> imitation_;
  PolicyLoss<Scalar> policy_loss_;  // of the newest update that improved the policy
};

std::unique_ptr<Algorithm> MakeContinuousDbr(const AlgorithmSpec& spec);

}  // namespace dbr
