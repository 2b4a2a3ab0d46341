#include "learner/algorithms/sac.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/parts/learning_rate.h"
#include "learner/parts/policy_export.h"
#include "learner/parts/update_metrics.h"

namespace dbr {
namespace {

// A temperature may fall low where rewards are small; above e^5 it is out of hand.
constexpr MultiplierLimits kTemperatureLimits{.min_log = -20, .max_log = 5};

}  // namespace

template <class Scalar>
Sac<Scalar>::Sac(const AlgorithmSpec& spec)
    : spec_(spec),
      rng_(spec.seed),
      policy_shape_(spec.observation_size, spec.hidden_sizes, 2 * spec.actions.size),
      critic_shape_(spec.observation_size + spec.actions.size, spec.hidden_sizes, 1),
      runner_(UpdateThreads(spec.config)),
      policy_(policy_shape_, spec.config.learning_rate(), /*with_target=*/false, rng_),
      critics_(critic_shape_, spec.config.learning_rate(), rng_, &runner_),
      temperature_(spec.config.sac().first_temperature(), spec.config.sac().temperature_learning_rate(),
                   kTemperatureLimits),
      target_entropy_(static_cast<Scalar>(spec.config.sac().target_entropy() * spec.actions.size)),
      metrics_{{"train/critic_loss"},    {"train/actor_loss"},         {"train/temperature"},
               {"train/policy_entropy"}, {"train/value_mean"},         {"train/target_mean"},
               {"train/advantage_mean"}, {"train/advantage_positive"}, {"train/advantage_std"}} {}

template <class Scalar>
absl::Status Sac<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                 const BasicBatch<Scalar>&) {
  const double learning_rate = LearningRate(spec_.config, updates_);
  policy_.set_learning_rate(learning_rate);
  critics_.set_learning_rate(learning_rate);
  const Scalar critic_loss = FitCritics(uniform);
  const SoftPolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  critics_.UpdateTargets(spec_.config.target_tau());
  ++updates_;
  advantages_.resize(static_cast<std::size_t>(uniform.size()));
  Eigen::Map<Eigen::VectorXf>(advantages_.data(), uniform.size()) =
      (regression_.behavior_value() - value_).template cast<float>();
  const AdvantageFigures advantages = FiguresOf(advantages_);
  return SetMetrics(
      {critic_loss, policy_loss.loss, temperature_.value(), policy_loss.entropy, policy_loss.value,
       regression_.target().mean(), advantages.mean, advantages.positive, advantages.deviation},
      updates_, &metrics_);
}

template <class Scalar>
Scalar Sac<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  head_.Split(policy_.Evaluate(batch.next_observations), kPolicyLogStd);
  FillNormal(rng_, spec_.actions.size, n, &noise_);
  next_draws_.Draw(head_, noise_);
  critics_.EvaluateTargets(next_draws_.CriticInput(batch.next_observations));
  next_value_.resize(n);
  MeanOfSmaller<Scalar>(critics_.target1(), critics_.target2(), &next_value_);
  next_value_ -= temperature_.value() * next_draws_.sample().log_prob;
  return regression_.Fit(batch, spec_.config.reward_scale(), next_value_, &critics_);
}

template <class Scalar>
SoftPolicyLoss<Scalar> Sac<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  head_.Split(policy_.Forward(batch.observations), kPolicyLogStd);
  FillNormal(rng_, spec_.actions.size, n, &noise_);
  const SoftPolicyLoss<Scalar> loss =
      objective_.Compute(head_, batch.observations, noise_, temperature_.value(), &critics_, &d_output_);
  policy_.Step(batch.observations, d_output_);
  value_.resize(n);
  MeanOfSmaller<Scalar>(critics_.value1(), critics_.value2(), &value_);
  temperature_.Step(target_entropy_ - loss.entropy);
  return loss;
}

template <class Scalar>
double Sac<Scalar>::UpdateFlops() const {
  const Eigen::Index n = needs().uniform;
  return critics_.TargetFlops(n) + critics_.FitFlops(n) + critics_.InputGradientFlops(n) +
         2 * policy_shape_.ForwardFlops(n) + policy_shape_.ParameterGradientFlops(n);
}

template <class Scalar>
void Sac<Scalar>::ExportPolicy(PolicySnapshot* snapshot) const {
  BeginExport(spec_, snapshot);
  ExportNetwork(kPolicyNetwork, policy_.parameters(), snapshot);
  ExportNetwork(kCritic1, critics_.first().parameters(), snapshot);
  ExportNetwork(kCritic2, critics_.second().parameters(), snapshot);
}

template <class Scalar>
void Sac<Scalar>::Save(TensorFile* file) const {
  policy_.Save(kPolicyNetwork, file);
  critics_.Save(file);
  temperature_.Save(file);
  PutRng("sac.rng", rng_, file);
  PutCounter("sac.updates", updates_, file);
}

template <class Scalar>
absl::Status Sac<Scalar>::Load(const TensorFile& file) {
  absl::Status status = policy_.Load(kPolicyNetwork, file);
  status.Update(critics_.Load(file));
  status.Update(temperature_.Load(file));
  status.Update(GetRng("sac.rng", file, &rng_));
  status.Update(GetCounter("sac.updates", file, &updates_));
  return status;
}

template class Sac<float>;
template class Sac<double>;

std::unique_ptr<Algorithm> MakeSac(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Sac>>(spec);
}

}  // namespace dbr
