#include "learner/algorithms/continuous_dbr.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/objectives/munchausen.h"

namespace dbr {

template <class Scalar>
ContinuousDbr<Scalar>::ContinuousDbr(const AlgorithmSpec& spec)
    : Base(DualBehaviorNetworks<Scalar>::Metrics(), spec),
      options_(PolicyLossOptions::Of(spec.config.dbr())) {}

template <class Scalar>
absl::Status ContinuousDbr<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                                           const BasicBatch<Scalar>& minus) {
  networks_.Begin();
  FitBehaviors(plus, minus);
  EvaluatePolicy(uniform);
  ComputeNextValue(uniform);
  EvaluateBehaviors(uniform);
  const Scalar critic_loss = regression_.Fit(uniform, networks_.spec.config.reward_scale(), next_value_,
                                             &networks_.critics, RewardBonus(uniform));
  ImprovePolicy(uniform);
  JudgeAndImitate(uniform);
  const double target_entropy = networks_.controls.target_entropy.value_or(config().target_entropy());
  networks_.Finish(policy_loss_, static_cast<Scalar>(target_entropy * networks_.spec.actions.size));
  return networks_.Report({critic_loss, beta_plus_.loss(), beta_minus_.loss()}, policy_loss_,
                          regression_.target().mean(), &metrics_);
}

template <class Scalar>
void ContinuousDbr<Scalar>::FitBehaviors(const BasicBatch<Scalar>& plus, const BasicBatch<Scalar>& minus) {
  networks_.runner.Run(
      [&] {
        if (!ImitatesItself(config())) beta_plus_.Fit(plus, nullptr, &networks_.beta_plus);
      },
      [&] { beta_minus_.Fit(minus, nullptr, &networks_.beta_minus); });
}

template <class Scalar>
void ContinuousDbr<Scalar>::EvaluatePolicy(const BasicBatch<Scalar>& batch) {
  networks_.runner.Run([&] { next_.EvaluatePolicy(batch.next_observations, &networks_.policy); },
                       [&] { pi_.Split(networks_.policy.Forward(batch.observations), kPolicyLogStd); });
}

template <class Scalar>
void ContinuousDbr<Scalar>::ComputeNextValue(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  FillNormal(networks_.rng, networks_.spec.actions.size, config().target_samples() * n, &next_noise_);
  const auto temperature = networks_.soft ? std::optional<Scalar>(networks_.tau()) : std::nullopt;
  next_value_ =
      next_.Compute(batch.next_observations, next_noise_, static_cast<Scalar>(config().target_min_weight()),
                    &networks_.critics, temperature);
  if (config().value_penalty() && networks_.constrained) {
    DrawDivergenceNoise(n);
    penalty_.Compute({options_.divergence, options_.mmd_sigma}, next_.pi(),
                     beta_plus_.At(batch.next_observations, &networks_.beta_plus), {noise_.pi, noise_.plus});
    // alpha is in units of the policy's Q term.
    const Scalar unit = options_.normalize_q ? next_value_.cwiseAbs().mean() : Scalar{1};
    next_value_ -= networks_.alpha() * unit * penalty_.value();
  }
}

template <class Scalar>
void ContinuousDbr<Scalar>::EvaluateBehaviors(const BasicBatch<Scalar>& batch) {
  networks_.runner.Run(
      [&] {
        if (networks_.needs_plus()) beta_plus_.At(batch.observations, &networks_.beta_plus);
      },
      [&] {
        if (networks_.needs_minus()) beta_minus_.At(batch.observations, &networks_.beta_minus);
      });
}

template <class Scalar>
const VectorX<Scalar>* ContinuousDbr<Scalar>::RewardBonus(const BasicBatch<Scalar>& batch) {
  const double weight = config().munchausen_weight();
  if (weight == 0) return nullptr;
  TanhLogProb<Scalar>(beta_plus_.head().view(), batch.actions, &log_prob_, &unused_gradient_);
  MunchausenBonus<Scalar>(weight, log_prob_, &bonus_);
  return &bonus_;
}

template <class Scalar>
void ContinuousDbr<Scalar>::DrawDivergenceNoise(Eigen::Index n) {
  if (!IsSampled(options_.divergence)) return;
  const Eigen::Index columns = n * config().divergence_samples();
  for (MatrixX<Scalar>* noise : {&noise_.pi, &noise_.plus, &noise_.minus}) {
    FillNormal(networks_.rng, networks_.spec.actions.size, columns, noise);
  }
}

template <class Scalar>
void ContinuousDbr<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  FillNormal(networks_.rng, networks_.spec.actions.size, config().policy_samples() * n, &noise_.actions);
  if (networks_.improves_policy()) {
    DrawDivergenceNoise(n);
    options_.use_q = networks_.uses_q();
    options_.entropy_weight = networks_.EntropyWeight();
    if (ImitatesItself(config())) {
      earned_ = static_cast<Scalar>(networks_.spec.config.reward_scale()) * batch.returns;
    }
    const VectorX<Scalar>& worth = ImitatesItself(config()) ? earned_ : regression_.behavior_value();
    policy_loss_ =
        objective_.Compute(options_, {pi_, beta_plus_.head(), beta_minus_.head()}, batch.observations,
                           {batch.actions, worth}, noise_, networks_.alpha(), &networks_.critics, &d_output_);
    networks_.policy.Step(batch.observations, d_output_);
  } else {
    objective_.Evaluate({pi_, batch.observations, noise_.actions}, &networks_.critics);
  }
  value_.resize(n);
  objective_.StateValue(networks_.critics, &value_);
}

template <class Scalar>
void ContinuousDbr<Scalar>::JudgeAndImitate(const BasicBatch<Scalar>& batch) {
  if (ImitatesItself(config())) {
    imitation_.Judge(batch, networks_.spec.config.reward_scale(), value_);
    networks_.SetAdvantages(imitation_.advantage());
    if (imitation_.imitates()) beta_plus_.Fit(batch, &imitation_.weights(), &networks_.beta_plus);
  } else {
    networks_.SetAdvantages(regression_.behavior_value() - value_);
  }
  if (config().behavior_data() == DbrConfig::BATCH) {
    networks_.FitBehaviorsTo(batch, &beta_plus_, &beta_minus_);
  }
}

template <class Scalar>
double ContinuousDbr<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  const Eigen::Index draws = n * config().policy_samples();
  return critics.TargetFlops(n * config().target_samples()) + critics.FitFlops(n) +
         critics.TargetFlops(draws) +
         critics.FirstInputGradientFlops(draws) / config().updates_per_policy_update() +
         networks_.PolicyFlops();
}

template class ContinuousDbr<float>;
template class ContinuousDbr<double>;

std::unique_ptr<Algorithm> MakeContinuousDbr(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<ContinuousDbr>>(spec);
}

}  // namespace dbr
