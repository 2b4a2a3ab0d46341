#include "learner/algorithms/discrete_dbr.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/objectives/critic_target.h"
#include "learner/objectives/munchausen.h"

namespace dbr {
template <class Scalar>
DiscreteDbr<Scalar>::DiscreteDbr(const AlgorithmSpec& spec)
    : Base(DualBehaviorNetworks<Scalar>::Metrics(), spec),
      options_(PolicyLossOptions::Of(spec.config.dbr())) {}

template <class Scalar>
absl::Status DiscreteDbr<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                                         const BasicBatch<Scalar>& minus) {
  networks_.Begin();
  FitBehaviors(plus, minus);
  ComputeTargets(uniform);
  EvaluateBehaviors(uniform);
  RaiseRewards(uniform);
  const Scalar critic_loss =
      networks_.critics.Fit(uniform.observations, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
        return CriticLoss<Scalar>(q, uniform.actions, target_, d_q);
      });
  ImprovePolicy(uniform);
  JudgeAndImitate(uniform);
  networks_.Finish(policy_loss_, static_cast<Scalar>(config().target_entropy_ratio()) *
                                     MeanGreatestEntropy<Scalar>(uniform.masks));
  return networks_.Report({critic_loss, beta_plus_.loss(), beta_minus_.loss()}, policy_loss_, target_.mean(),
                          &metrics_);
}

template <class Scalar>
void DiscreteDbr<Scalar>::FitBehaviors(const BasicBatch<Scalar>& plus, const BasicBatch<Scalar>& minus) {
  networks_.runner.Run(
      [&] {
        if (!ImitatesItself(config())) beta_plus_.Fit(plus, nullptr, &networks_.beta_plus);
      },
      [&] { beta_minus_.Fit(minus, nullptr, &networks_.beta_minus); });
}

template <class Scalar>
void DiscreteDbr<Scalar>::ComputeTargets(const BasicBatch<Scalar>& batch) {
  MaskedSoftmax<Scalar>(networks_.policy.ForwardTarget(batch.next_observations), batch.next_masks, &next_pi_);
  const auto min_weight = static_cast<Scalar>(config().target_min_weight());
  networks_.critics.EvaluateTargets(batch.next_observations);
  ExpectedTargetValue<Scalar>(next_pi_, networks_.critics.target1(), networks_.critics.target2(), min_weight,
                              &target_);
  if (networks_.soft) {
    Entropy(next_pi_, &next_entropy_);
    target_ += networks_.tau() * next_entropy_;
  }
  if (config().value_penalty() && networks_.constrained) {
    Divergence<Scalar>(options_.divergence, static_cast<Scalar>(options_.mmd_sigma), next_pi_,
                       beta_plus_.At(batch.next_observations, batch.next_masks, &networks_.beta_plus),
                       &penalty_, nullptr);
    // alpha is in units of the policy's Q term.
    const Scalar unit = options_.normalize_q ? target_.cwiseAbs().mean() : Scalar{1};
    target_ -= networks_.alpha() * unit * penalty_;
  }
  CriticTarget(batch, networks_.spec.config.reward_scale(), target_, &target_);
}

template <class Scalar>
void DiscreteDbr<Scalar>::EvaluateBehaviors(const BasicBatch<Scalar>& batch) {
  networks_.runner.Run(
      [&] {
        if (networks_.needs_plus()) beta_plus_.At(batch.observations, batch.masks, &networks_.beta_plus);
      },
      [&] {
        if (networks_.needs_minus()) beta_minus_.At(batch.observations, batch.masks, &networks_.beta_minus);
      });
}

template <class Scalar>
void DiscreteDbr<Scalar>::RaiseRewards(const BasicBatch<Scalar>& batch) {
  const double weight = config().munchausen_weight();
  if (weight == 0) return;
  log_prob_.resize(batch.size());
  for (Eigen::Index j = 0; j < batch.size(); ++j) {
    log_prob_[j] =
        beta_plus_.distribution().log_probabilities(static_cast<Eigen::Index>(batch.actions(0, j)), j);
  }
  MunchausenBonus<Scalar>(weight, log_prob_, &bonus_);
  target_ += static_cast<Scalar>(networks_.spec.config.reward_scale()) * bonus_;
}

template <class Scalar>
void DiscreteDbr<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  MaskedSoftmax<Scalar>(networks_.policy.Forward(batch.observations), batch.masks, &pi_);
  if (!networks_.improves_policy()) return;
  options_.use_q = networks_.uses_q();
  options_.entropy_weight = networks_.EntropyWeight();
  policy_loss_ = DualBehaviorPolicyLoss<Scalar>(options_, pi_, networks_.critics.q1(), networks_.critics.q2(),
                                                beta_plus_.distribution(), beta_minus_.distribution(),
                                                networks_.alpha(), &workspace_, &d_logits_);
  networks_.policy.Step(batch.observations, d_logits_);
}

template <class Scalar>
void DiscreteDbr<Scalar>::JudgeAndImitate(const BasicBatch<Scalar>& batch) {
  const MatrixX<Scalar>&q1 = networks_.critics.q1(), &q2 = networks_.critics.q2();
  ExpectedTargetValue<Scalar>(pi_, q1, q2, /*min_weight=*/1, &value_);
  if (!ImitatesItself(config())) {
    ComputeAdvantages<Scalar>(q1, q2, batch.actions, value_, &networks_.advantages);
  } else {
    imitation_.Judge(batch, networks_.spec.config.reward_scale(), value_);
    if (imitation_.imitates()) beta_plus_.Fit(batch, &imitation_.weights(), &networks_.beta_plus);
    networks_.SetAdvantages(imitation_.advantage());
  }
  if (config().behavior_data() == DbrConfig::BATCH) {
    networks_.FitBehaviorsTo(batch, &beta_plus_, &beta_minus_);
  }
}

template <class Scalar>
double DiscreteDbr<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  return networks_.critics.TargetFlops(n) + networks_.critics.FitFlops(n) + networks_.PolicyFlops();
}

template class DiscreteDbr<float>;
template class DiscreteDbr<double>;

std::unique_ptr<Algorithm> MakeDiscreteDbr(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<DiscreteDbr>>(spec);
}

}  // namespace dbr
