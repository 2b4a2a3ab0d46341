#include "learner/algorithms/continuous_dbr.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/parts/learning_rate.h"
#include "learner/parts/policy_export.h"
#include "learner/parts/update_metrics.h"

namespace dbr {

template <class Scalar>
ContinuousDbr<Scalar>::ContinuousDbr(const AlgorithmSpec& spec)
    : spec_(spec),
      needs_(DualBehaviorNeeds(spec.config)),
      options_(PolicyLossOptions::Of(spec.config.dbr())),
      rng_(spec.seed),
      policy_shape_(spec.observation_size, spec.hidden_sizes, 2 * spec.actions.size),
      critic_shape_(spec.observation_size + spec.actions.size, spec.hidden_sizes, 1),
      runner_(UpdateThreads(spec.config)),
      policy_(policy_shape_, spec.config.learning_rate(), /*with_target=*/true, rng_),
      critics_(critic_shape_, spec.config.learning_rate(), rng_, &runner_),
      beta_plus_{
          TrainedNetwork<Scalar>(policy_shape_, spec.config.learning_rate(), /*with_target=*/false, rng_)},
      beta_minus_{
          TrainedNetwork<Scalar>(policy_shape_, spec.config.learning_rate(), /*with_target=*/false, rng_)},
      multiplier_(spec.config.dbr().first_multiplier(), spec.config.dbr().multiplier_learning_rate()),
      metrics_{{"train/critic_loss"},        {"train/actor_loss"},      {"train/beta_plus_loss"},
               {"train/beta_minus_loss"},    {"train/divergence_plus"}, {"train/divergence_minus"},
               {"train/threshold"},          {"train/multiplier"},      {"train/policy_entropy"},
               {"train/value_mean"},         {"train/target_mean"},     {"train/advantage_mean"},
               {"train/advantage_positive"}, {"train/advantage_std"}} {}

template <class Scalar>
absl::Status ContinuousDbr<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                                           const BasicBatch<Scalar>& minus) {
  SetLearningRate(LearningRate(spec_.config, updates_));
  runner_.Run([&] { FitBehavior(plus, &beta_plus_); }, [&] { FitBehavior(minus, &beta_minus_); });
  ComputeTargets(uniform);
  const Scalar critic_loss = FitCritics(uniform);
  const PolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  multiplier_.Step(policy_loss.divergence_plus - policy_loss.threshold);
  critics_.UpdateTargets(spec_.config.target_tau());
  policy_.UpdateTarget(spec_.config.target_tau());
  ++updates_;
  return Report(critic_loss, policy_loss);
}

template <class Scalar>
void ContinuousDbr<Scalar>::SetLearningRate(double learning_rate) {
  policy_.set_learning_rate(learning_rate);
  critics_.set_learning_rate(learning_rate);
  beta_plus_.network.set_learning_rate(learning_rate);
  beta_minus_.network.set_learning_rate(learning_rate);
}

template <class Scalar>
void ContinuousDbr<Scalar>::FitBehavior(const BasicBatch<Scalar>& batch, Behavior* behavior) {
  if (batch.size() == 0) return;
  behavior->head.Split(behavior->network.Forward(batch.observations), kBehaviorLogStd);
  TanhLogProb<Scalar>(behavior->head.view(), batch.actions, &behavior->log_prob, &behavior->gradient);
  behavior->loss = -behavior->log_prob.mean();
  const Scalar weight = -1 / static_cast<Scalar>(batch.size());
  behavior->gradient.mean *= weight;
  behavior->gradient.log_std *= weight;
  behavior->head.Join(behavior->gradient, &behavior->d_output);
  behavior->network.Step(batch.observations, behavior->d_output);
}

template <class Scalar>
void ContinuousDbr<Scalar>::ComputeTargets(const BasicBatch<Scalar>& batch) {
  const DbrConfig& config = spec_.config.dbr();
  const Eigen::Index n = batch.size();
  next_pi_.Split(policy_.ForwardTarget(batch.next_observations), kPolicyLogStd);
  FillNormal(rng_, spec_.actions.size, config.target_samples() * n, &next_noise_);
  next_draws_.DrawActions(next_pi_, next_noise_);
  critics_.EvaluateTargets(next_draws_.CriticInput(batch.next_observations));
  target_.resize(n);
  GreatestTargetValue<Scalar>(critics_.target1(), critics_.target2(),
                              static_cast<Scalar>(config.target_min_weight()), &target_);
  if (config.value_penalty()) {
    DrawDivergenceNoise(n);
    beta_plus_.head.Split(beta_plus_.network.Evaluate(batch.next_observations), kBehaviorLogStd);
    penalty_.Compute({options_.divergence, options_.mmd_sigma}, next_pi_, beta_plus_.head,
                     {noise_.pi, noise_.plus});
    target_ -= multiplier_.value() * penalty_.value();
  }
  target_ = static_cast<Scalar>(spec_.config.reward_scale()) * batch.rewards +
            batch.discounts.cwiseProduct(target_);
}

template <class Scalar>
Scalar ContinuousDbr<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  inputs_.resize(critic_shape_.input_size(), batch.size());
  inputs_ << batch.observations, batch.actions;
  const Scalar loss = critics_.Fit(inputs_, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
    return SquaredError<Scalar>(q, target_, d_q);
  });
  behavior_value_.resize(batch.size());
  MeanOfSmaller<Scalar>(critics_.q1(), critics_.q2(), &behavior_value_);
  return loss;
}

template <class Scalar>
void ContinuousDbr<Scalar>::DrawDivergenceNoise(Eigen::Index n) {
  if (!IsSampled(options_.divergence)) return;
  const Eigen::Index columns = n * spec_.config.dbr().divergence_samples();
  for (MatrixX<Scalar>* noise : {&noise_.pi, &noise_.plus, &noise_.minus}) {
    FillNormal(rng_, spec_.actions.size, columns, noise);
  }
}

template <class Scalar>
PolicyLoss<Scalar> ContinuousDbr<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const DbrConfig& config = spec_.config.dbr();
  const Eigen::Index n = batch.size();
  const auto evaluate = [&](Behavior* behavior) {
    behavior->head.Split(behavior->network.Evaluate(batch.observations), kBehaviorLogStd);
  };
  runner_.Run([&] { evaluate(&beta_plus_); }, [&] { evaluate(&beta_minus_); });
  pi_.Split(policy_.Forward(batch.observations), kPolicyLogStd);
  FillNormal(rng_, spec_.actions.size, config.policy_samples() * n, &noise_.actions);
  DrawDivergenceNoise(n);
  options_.use_q = updates_ >= config.warm_start_updates();
  const PolicyLoss<Scalar> loss =
      objective_.Compute(options_, {pi_, beta_plus_.head, beta_minus_.head}, batch.observations, noise_,
                         multiplier_.value(), &critics_, &d_output_);
  policy_.Step(batch.observations, d_output_);
  value_.resize(n);
  objective_.StateValue(critics_, &value_);
  advantages_.resize(static_cast<std::size_t>(n));
  Eigen::Map<Eigen::VectorXf>(advantages_.data(), n) = (behavior_value_ - value_).template cast<float>();
  return loss;
}

template <class Scalar>
absl::Status ContinuousDbr<Scalar>::Report(Scalar critic_loss, const PolicyLoss<Scalar>& policy_loss) {
  const AdvantageFigures advantages = FiguresOf(advantages_);
  return SetMetrics(
      {critic_loss, policy_loss.loss, beta_plus_.loss, beta_minus_.loss, policy_loss.divergence_plus,
       policy_loss.divergence_minus, policy_loss.threshold, multiplier_.value(), policy_loss.entropy,
       policy_loss.value, target_.mean(), advantages.mean, advantages.positive, advantages.deviation},
      updates_, &metrics_);
}

template <class Scalar>
double ContinuousDbr<Scalar>::UpdateFlops() const {
  const DbrConfig& config = spec_.config.dbr();
  const Eigen::Index n = needs_.uniform;
  double flops = critics_.TargetFlops(n * config.target_samples()) + critics_.FitFlops(n) +
                 critics_.InputGradientFlops(n * config.policy_samples());
  for (const int behavior : {needs_.plus, needs_.minus}) {
    flops += policy_shape_.ForwardFlops(behavior) + policy_shape_.ParameterGradientFlops(behavior);
  }
  const int forward = 4 + (config.value_penalty() ? 1 : 0);  // pi' at s'; pi, beta+ and beta- at s
  return flops + forward * policy_shape_.ForwardFlops(n) + policy_shape_.ParameterGradientFlops(n);
}

template <class Scalar>
void ContinuousDbr<Scalar>::ExportPolicy(PolicySnapshot* snapshot) const {
  BeginExport(spec_, snapshot);
  snapshot->support_epsilon = static_cast<float>(spec_.config.dbr().epsilon());
  ExportNetwork(kPolicyNetwork, policy_.parameters(), snapshot);
  ExportNetwork(kCritic1, critics_.first().parameters(), snapshot);
  ExportNetwork(kCritic2, critics_.second().parameters(), snapshot);
  ExportNetwork(kBetaPlus, beta_plus_.network.parameters(), snapshot);
  ExportNetwork(kBetaMinus, beta_minus_.network.parameters(), snapshot);
}

template <class Scalar>
void ContinuousDbr<Scalar>::Save(TensorFile* file) const {
  policy_.Save(kPolicyNetwork, file);
  critics_.Save(file);
  beta_plus_.network.Save(kBetaPlus, file);
  beta_minus_.network.Save(kBetaMinus, file);
  multiplier_.Save(file);
  PutRng("dbr.rng", rng_, file);
  PutCounter("dbr.updates", updates_, file);
}

template <class Scalar>
absl::Status ContinuousDbr<Scalar>::Load(const TensorFile& file) {
  absl::Status status = policy_.Load(kPolicyNetwork, file);
  status.Update(critics_.Load(file));
  status.Update(beta_plus_.network.Load(kBetaPlus, file));
  status.Update(beta_minus_.network.Load(kBetaMinus, file));
  status.Update(multiplier_.Load(file));
  status.Update(GetRng("dbr.rng", file, &rng_));
  status.Update(GetCounter("dbr.updates", file, &updates_));
  return status;
}

template class ContinuousDbr<float>;
template class ContinuousDbr<double>;

std::unique_ptr<Algorithm> MakeContinuousDbr(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<ContinuousDbr>>(spec);
}

}  // namespace dbr
