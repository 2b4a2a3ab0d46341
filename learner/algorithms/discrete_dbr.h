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

// State: policy pi with target pi', twin critics with targets, the behaviour policies beta+ of D+ and beta-
// of D-, and a multiplier alpha. One update, with B drawn from D, B+ from D+ and B- from D-:
//   1. beta+ maximises the mean of log beta+(a|s) over B+, beta- over B- (the definitions below the paper's
//   equation 3;
//      an empty part skips its step).
//   2. y = r + discount * V'(s'), V' the expectation under pi' of 0.75 min_i Q'_i + 0.25 max_i Q'_i; each
//   critic
//      regresses on y. With value_penalty, V' is reduced by alpha * D(pi'(.|s'), beta+(.|s')) (the paper's
//      equation for V under beta+).
//   3. pi minimises -E[min_i E_pi Q_i] + alpha * (D(pi, beta+) - c), the dynamic constraint of the paper's
//   section
//      "From ARM and BEAR to DBR".
//   4. alpha ascends on alpha * (D(pi, beta+) - c).
//   5. Polyak averaging of the critics and of pi.
//   6. A = Q(s, a) - V(s) of every transition of B, Q the smaller twin, V its expectation under pi.
//
// With advantage SIL (the paper's section "ARM and SIL"; Oh et al. 2018) step 6 takes A = reward_scale * R -
// V(s), R the Monte-Carlo return, and beta+ is not fitted to B+ but after step 6, in a step of its own, to B:
// it maximises the mean of w log beta+(a|s), w = max(A, 0) divided by its mean over B (skipped where all are
// 0). The critics take no part in it.
// With munchausen_weight w the r of step 2 is r + w * log beta+(a|s), the log clipped to [-1, 0], before it
// is scaled (the paper's section on ablations), beta+ being that of step 1.
// With constraint NONE step 3 has no second term, and there is no step 4.
//
// Departures: steps 3 and 6 use the critics' values from before step 2's gradient step, and step 6 the
// policy's from before step 3's, so that nothing is computed twice. entropy_weight adds the entropy term of
// discrete SAC to step 3.
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
  // beta+ and beta- at the batch's states.
  void EvaluateBehaviors(const BasicBatch<Scalar>& batch);
  // After EvaluateBehaviors: the Munchausen term, into target_.
  void RaiseRewards(const BasicBatch<Scalar>& batch);
  PolicyLoss<Scalar> ImprovePolicy(const BasicBatch<Scalar>& batch);
  // After ImprovePolicy: the advantages, and self-imitation's fit.
  void JudgeAndImitate(const BasicBatch<Scalar>& batch);

  PolicyLossOptions options_;

  CategoricalLikelihood<Scalar> beta_plus_, beta_minus_;
  Categorical<Scalar> pi_, next_pi_;
  PolicyLossWorkspace<Scalar> workspace_;
  VectorX<Scalar> target_, penalty_, log_prob_, bonus_, value_;
  SelfImitation<Scalar> imitation_;
  MatrixX<Scalar> d_logits_;
};

std::unique_ptr<Algorithm> MakeDiscreteDbr(const AlgorithmSpec& spec);

}  // namespace dbr
