#include "learner/algorithms/discrete_dbr.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/parts/critic_target.h"

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
  networks_.runner.Run([&] { beta_plus_.Fit(plus, &networks_.beta_plus); },
                       [&] { beta_minus_.Fit(minus, &networks_.beta_minus); });
  ComputeTargets(uniform);
  const Scalar critic_loss =
      networks_.critics.Fit(uniform.observations, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
        return CriticLoss<Scalar>(q, uniform.actions, target_, d_q);
      });
  const PolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  ExpectedTargetValue<Scalar>(pi_, networks_.critics.q1(), networks_.critics.q2(), /*min_weight=*/1, &value_);
  ComputeAdvantages<Scalar>(networks_.critics.q1(), networks_.critics.q2(), uniform.actions, value_,
                            &advantages_);
  networks_.Finish(spec_.config, policy_loss);
  return networks_.Report({critic_loss, beta_plus_.loss(), beta_minus_.loss()}, policy_loss, target_.mean(),
                          advantages_, &metrics_);
}

template <class Scalar>
void DiscreteDbr<Scalar>::ComputeTargets(const BasicBatch<Scalar>& batch) {
  MaskedSoftmax<Scalar>(networks_.policy.ForwardTarget(batch.next_observations), batch.next_masks, &next_pi_);
  const auto min_weight = static_cast<Scalar>(spec_.config.dbr().target_min_weight());
  networks_.critics.EvaluateTargets(batch.next_observations);
  ExpectedTargetValue<Scalar>(next_pi_, networks_.critics.target1(), networks_.critics.target2(), min_weight,
                              &target_);
  if (spec_.config.dbr().value_penalty()) {
    Divergence<Scalar>(options_.divergence, static_cast<Scalar>(options_.mmd_sigma), next_pi_,
                       beta_plus_.At(batch.next_observations, batch.next_masks, &networks_.beta_plus),
                       &penalty_, nullptr);
    target_ -= networks_.multiplier.value() * penalty_;
  }
  CriticTarget(batch, spec_.config.reward_scale(), target_, &target_);
}

template <class Scalar>
PolicyLoss<Scalar> DiscreteDbr<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  networks_.runner.Run([&] { beta_plus_.At(batch.observations, batch.masks, &networks_.beta_plus); },
                       [&] { beta_minus_.At(batch.observations, batch.masks, &networks_.beta_minus); });
  MaskedSoftmax<Scalar>(networks_.policy.Forward(batch.observations), batch.masks, &pi_);
  options_.use_q = networks_.updates >= spec_.config.dbr().warm_start_updates();
  const PolicyLoss<Scalar> loss = DualBehaviorPolicyLoss<Scalar>(
      options_, pi_, networks_.critics.q1(), networks_.critics.q2(), beta_plus_.distribution(),
      beta_minus_.distribution(), networks_.multiplier.value(), &workspace_, &d_logits_);
  networks_.policy.Step(batch.observations, d_logits_);
  return loss;
}

template <class Scalar>
double DiscreteDbr<Scalar>::UpdateFlops() const {
  return networks_.critics.TargetFlops(needs_.uniform) + networks_.critics.FitFlops(needs_.uniform) +
         networks_.PolicyFlops(needs_, spec_.config.dbr().value_penalty() ? 2 : 1);
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
