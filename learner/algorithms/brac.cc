#include "learner/algorithms/brac.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/training/update_metrics.h"

namespace dbr {
template <class Scalar>
Brac<Scalar>::Brac(const AlgorithmSpec& spec)
    : Base({{"train/critic_loss"},
            {"train/actor_loss"},
            {"train/behavior_loss"},
            {"train/divergence"},
            {"train/multiplier"},
            {"train/policy_entropy"},
            {"train/value_mean"},
            {"train/target_mean"},
            {"train/advantage_mean"},
            {"train/advantage_positive"},
            {"train/advantage_std"}},
           spec),
      behavior_(networks_.policy.shape(), networks_.Options(spec, /*with_target=*/false), networks_.rng),
      multiplier_(spec.config.brac().first_multiplier(), spec.config.brac().multiplier_learning_rate()) {}

template <class Scalar>
absl::Status Brac<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                  const BasicBatch<Scalar>&) {
  behavior_.set_learning_rate(networks_.Begin());
  networks_.runner.Run(
      [&] { beta_.Fit(uniform, nullptr, &behavior_); },
      [&] { next_pi_.Split(networks_.policy.ForwardTarget(uniform.next_observations), kPolicyLogStd); });
  ComputeNextValue(uniform);
  const Scalar critic_loss =
      regression_.Fit(uniform, networks_.spec.config.reward_scale(), next_value_, &networks_.critics);
  const BehaviorKlLoss<Scalar> loss = ImprovePolicy(uniform);
  networks_.SetAdvantages(regression_.behavior_value() - value_);
  if (config().adaptive_multiplier()) {
    multiplier_.Step(loss.divergence - static_cast<Scalar>(config().epsilon()));
  }
  ++networks_.updates;
  const AdvantageFigures advantages = FiguresOf(networks_.advantages);
  return SetMetrics(
      {critic_loss, loss.loss, beta_.loss(), loss.divergence, multiplier_.value(), loss.entropy, loss.value,
       regression_.target().mean(), advantages.mean, advantages.positive, advantages.deviation},
      networks_.updates, &metrics_);
}

template <class Scalar>
void Brac<Scalar>::ComputeNextValue(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  CriticEnsemble<Scalar>& critics = networks_.critics;
  FillNormal(networks_.rng, networks_.spec.actions.size, n, &next_noise_);
  next_draws_.DrawActions(next_pi_, next_noise_);
  critics.EvaluateTargets(next_draws_.CriticInput(batch.next_observations));
  next_value_.resize(n);
  GreatestTargetValue<Scalar>(critics.target1(), critics.target2(),
                              static_cast<Scalar>(config().target_min_weight()), &next_value_);
  if (config().variant() != BracConfig::VP) return;
  next_beta_.Split(behavior_.Evaluate(batch.next_observations), kBehaviorLogStd);
  SampledKl<Scalar>(next_pi_.view(), next_beta_.view(), next_noise_, &next_kl_, nullptr);
  next_value_ -= multiplier_.value() * next_kl_;
}

template <class Scalar>
BehaviorKlLoss<Scalar> Brac<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  pi_.Split(networks_.policy.Forward(batch.observations), kPolicyLogStd);
  FillNormal(networks_.rng, networks_.spec.actions.size, config().divergence_samples() * n, &noise_);
  const BehaviorKlLoss<Scalar> loss = objective_.Compute(
      {pi_, beta_.head(), noise_}, batch.observations, multiplier_.value(),
      /*use_q=*/networks_.updates >= config().warm_start_updates(), &networks_.critics, &d_output_);
  networks_.policy.Step(batch.observations, d_output_);
  value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.value1(), networks_.critics.value2(), &value_);
  return loss;
}

template <class Scalar>
double Brac<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  const MlpShape& policy = networks_.policy.shape();
  // pi and beta at s, and pi' at s'. VP evaluates beta at s' too.
  const int forward = config().variant() == BracConfig::VP ? 4 : 3;
  return critics.TargetFlops(n) + critics.FitFlops(n) +
         critics.InputGradientFlops(n * config().divergence_samples()) + forward * policy.ForwardFlops(n) +
         2 * policy.ParameterGradientFlops(n);
}

template <class Scalar>
void Brac<Scalar>::Save(TensorFile* file) const {
  networks_.Save(file);
  behavior_.Save(kBehavior, file);
  multiplier_.Save(file);
}

template <class Scalar>
absl::Status Brac<Scalar>::Load(const TensorFile& file) {
  absl::Status status = networks_.Load(file);
  status.Update(behavior_.Load(kBehavior, file));
  status.Update(multiplier_.Load(file));
  return status;
}

template class Brac<float>;
template class Brac<double>;

std::unique_ptr<Algorithm> MakeBrac(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Brac>>(spec);
}

}  // namespace dbr
