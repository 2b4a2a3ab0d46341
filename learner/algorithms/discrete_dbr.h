// Dual Behavior Regularized reinforcement learning over discrete actions (Siu, Traish, Xu 2021).
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/dual_behavior_networks.h"
#include "learner/objectives/categorical_likelihood.h"
#include "learner/objectives/discrete_losses.h"
#include "learner/objectives/self_imitation.h"

namespace dbr {

// State: a policy pi with a target pi', twin critics with targets, the behaviour policies beta+ for D+ and
// beta- for D- (all three policies are softmaxes over the legal actions), and a multiplier alpha. One thread
// at a time. One update, with B drawn from D, B+ from D+ and B- from D-:
//   1. beta+ maximises the mean of log beta+(a|s) over B+, and beta- does the same over B- (the definitions
//      above the paper's equation 3). An empty part skips its step.
//   2. y = r + discount * V'(s'), where V' is the expectation under pi' of w min_i Q'_i + (1 - w) max_i Q'_i,
//      w = target_min_weight, and tau H(pi'(.|s')) on top. With value_penalty, alpha * D(pi'(.|s'),
//      beta+(.|s')) is subtracted from V' (the paper's equation 3), times the mean of |V'| where normalize_q
//      divides Q by its mean size. Each critic regresses on y.
//   3. pi minimises -(E[min_i E_pi Q_i] + tau H(pi)) + alpha * (D(pi, beta+) - c), the dynamic constraint of
//      the paper's section "From ARM and BEAR to DBR".
//   4. alpha ascends on alpha * (D(pi, beta+) - c). The temperature tau rises while the entropy H(pi) is less
//      than target_entropy_ratio of the greatest one and falls while it is more, as in discrete SAC. Without
//      first_temperature tau is 0 in step 2 and entropy_weight in step 3.
//   5. Polyak averaging of the critics and of pi.
//   6. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin, and V is its expectation under
//      pi.
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
// updates_per_policy_update k: steps 3 and 4 are made in every k-th update.
//
// Departures from the paper: steps 3 and 6 use the critics' values from before step 2's gradient step, and
// step 6 uses the policy from before step 3's, so that nothing is computed twice. entropy_weight and tau add
// the entropy term of discrete SAC.
template <class Scalar>
class DiscreteDbr : public ActorCriticAlgorithm<DualBehaviorNetworks<Scalar>> {
 public:
  explicit DiscreteDbr(const AlgorithmSpec& spec);

  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;

 private:
  using Base = ActorCriticAlgorithm<DualBehaviorNetworks<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const DbrConfig& config() const { return networks_.config(); }
  void FitBehaviors(const BasicBatch<Scalar>& plus, const BasicBatch<Scalar>& minus);
  void ComputeTargets(const BasicBatch<Scalar>& batch);
  // Evaluates beta+ at the states of the batch, and beta- where it can move the threshold.
  void EvaluateBehaviors(const BasicBatch<Scalar>& batch);
  // Adds the Munchausen term to target_. EvaluateBehaviors comes first.
  void RaiseRewards(const BasicBatch<Scalar>& batch);
  // Evaluates pi and, where this update improves it, makes its step.
  void ImprovePolicy(const BasicBatch<Scalar>& batch);
  // Sets the advantages and makes the fits that need them. ImprovePolicy comes first.
  void JudgeAndImitate(const BasicBatch<Scalar>& batch);

  PolicyLossOptions options_;

  CategoricalLikelihood<Scalar> beta_plus_, beta_minus_;
  Categorical<Scalar> pi_, next_pi_;
  PolicyLossWorkspace<Scalar> workspace_;
  PolicyLoss<Scalar> policy_loss_;  // of the newest update that improved the policy
  VectorX<Scalar> target_, penalty_, next_entropy_, log_prob_, bonus_, value_;  // [n]
  SelfImitation<Scalar> imitation_;
  MatrixX<Scalar> d_logits_;  // [actions x n]
};

std::unique_ptr<Algorithm> MakeDiscreteDbr(const AlgorithmSpec& spec);

}  // namespace dbr
