#include "learner/algorithms/discrete_dbr.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/parts/critic_target.h"
#include "learner/parts/munchausen.h"

namespace dbr {
template <class Scalar>
DiscreteDbr<Scalar>::DiscreteDbr(const AlgorithmSpec& spec)
    : spec_(spec),
      needs_(DualBehaviorNeeds(spec.config)),
      options_(PolicyLossOptions::Of(spec.config.dbr())),
      init_rng_(spec.seed),
      shape_(spec.observation_size, spec.hidden_sizes, spec.actions.size),
      networks_(spec, shape_, shape_, init_rng_),
      metrics_(networks_.Metrics()) {}

template <class Scalar>
absl::Status DiscreteDbr<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                                         const BasicBatch<Scalar>& minus) {
  networks_.Begin(spec_.config);
  FitBehaviors(plus, minus);
  ComputeTargets(uniform);
  EvaluateBehaviors(uniform);
  RaiseRewards(uniform);
  const Scalar critic_loss =
      networks_.critics.Fit(uniform.observations, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
        return CriticLoss<Scalar>(q, uniform.actions, target_, d_q);
      });
  const PolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  JudgeAndImitate(uniform);
  networks_.Finish(spec_.config, policy_loss);
  return networks_.Report({critic_loss, beta_plus_.loss(), beta_minus_.loss()}, policy_loss, target_.mean(),
                          advantages_, &metrics_);
}

template <class Scalar>
void DiscreteDbr<Scalar>::FitBehaviors(const BasicBatch<Scalar>& plus, const BasicBatch<Scalar>& minus) {
  networks_.runner.Run(
      [&] {
        if (!ImitatesItself(spec_.config.dbr())) beta_plus_.Fit(plus, nullptr, &networks_.beta_plus);
      },
      [&] { beta_minus_.Fit(minus, nullptr, &networks_.beta_minus); });
}

template <class Scalar>
void DiscreteDbr<Scalar>::ComputeTargets(const BasicBatch<Scalar>& batch) {
  MaskedSoftmax<Scalar>(networks_.policy.ForwardTarget(batch.next_observations), batch.next_masks, &next_pi_);
  const auto min_weight = static_cast<Scalar>(spec_.config.dbr().target_min_weight());
  networks_.critics.EvaluateTargets(batch.next_observations);
  ExpectedTargetValue<Scalar>(next_pi_, networks_.critics.target1(), networks_.critics.target2(), min_weight,
                              &target_);
  if (spec_.config.dbr().value_penalty() && networks_.constrained) {
    Divergence<Scalar>(options_.divergence, static_cast<Scalar>(options_.mmd_sigma), next_pi_,
                       beta_plus_.At(batch.next_observations, batch.next_masks, &networks_.beta_plus),
                       &penalty_, nullptr);
    target_ -= networks_.alpha() * penalty_;
  }
  CriticTarget(batch, spec_.config.reward_scale(), target_, &target_);
}

template <class Scalar>
void DiscreteDbr<Scalar>::EvaluateBehaviors(const BasicBatch<Scalar>& batch) {
  networks_.runner.Run([&] { beta_plus_.At(batch.observations, batch.masks, &networks_.beta_plus); },
                       [&] { beta_minus_.At(batch.observations, batch.masks, &networks_.beta_minus); });
}

template <class Scalar>
void DiscreteDbr<Scalar>::RaiseRewards(const BasicBatch<Scalar>& batch) {
  const double weight = spec_.config.dbr().munchausen_weight();
  if (weight == 0) return;
  log_prob_.resize(batch.size());
  for (Eigen::Index j = 0; j < batch.size(); ++j) {
    log_prob_[j] =
        beta_plus_.distribution().log_probabilities(static_cast<Eigen::Index>(batch.actions(0, j)), j);
  }
  MunchausenBonus<Scalar>(weight, log_prob_, &bonus_);
  target_ += static_cast<Scalar>(spec_.config.reward_scale()) * bonus_;
}

template <class Scalar>
PolicyLoss<Scalar> DiscreteDbr<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  MaskedSoftmax<Scalar>(networks_.policy.Forward(batch.observations), batch.masks, &pi_);
  options_.use_q = networks_.updates >= spec_.config.dbr().warm_start_updates();
  const PolicyLoss<Scalar> loss = DualBehaviorPolicyLoss<Scalar>(
      options_, pi_, networks_.critics.q1(), networks_.critics.q2(), beta_plus_.distribution(),
      beta_minus_.distribution(), networks_.alpha(), &workspace_, &d_logits_);
  networks_.policy.Step(batch.observations, d_logits_);
  return loss;
}

template <class Scalar>
void DiscreteDbr<Scalar>::JudgeAndImitate(const BasicBatch<Scalar>& batch) {
  const MatrixX<Scalar>&q1 = networks_.critics.q1(), &q2 = networks_.critics.q2();
  ExpectedTargetValue<Scalar>(pi_, q1, q2, /*min_weight=*/1, &value_);
  if (!ImitatesItself(spec_.config.dbr())) {
    ComputeAdvantages<Scalar>(q1, q2, batch.actions, value_, &advantages_);
    return;
  }
  imitation_.Judge(batch, spec_.config.reward_scale(), value_);
  if (imitation_.imitates()) beta_plus_.Fit(batch, &imitation_.weights(), &networks_.beta_plus);
  advantages_.resize(static_cast<std::size_t>(batch.size()));
  Eigen::Map<Eigen::VectorXf>(advantages_.data(), batch.size()) =
      imitation_.advantage().template cast<float>();
}

template <class Scalar>
double DiscreteDbr<Scalar>::UpdateFlops() const {
  return networks_.critics.TargetFlops(needs_.uniform) + networks_.critics.FitFlops(needs_.uniform) +
         networks_.PolicyFlops(needs_, spec_.config.dbr().value_penalty() && networks_.constrained ? 2 : 1);
}

template <class Scalar>
void DiscreteDbr<Scalar>::ExportPolicy(PolicySnapshot* snapshot) const {
  networks_.Export(spec_, snapshot);
}

template <class Scalar>
void DiscreteDbr<Scalar>::Save(TensorFile* file) const {
  networks_.Save(file);
}

template <class Scalar>
absl::Status DiscreteDbr<Scalar>::Load(const TensorFile& file) {
  return networks_.Load(file);
}

template class DiscreteDbr<float>;
template class DiscreteDbr<double>;

std::unique_ptr<Algorithm> MakeDiscreteDbr(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<DiscreteDbr>>(spec);
}

}  // namespace dbr
