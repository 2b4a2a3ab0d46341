#include "learner/algorithms/discrete_dbr.h"

#include <cmath>

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/parts/learning_rate.h"
#include "learner/parts/policy_export.h"
#include "learner/parts/update_metrics.h"

namespace dbr {
template <class Scalar>
DiscreteDbr<Scalar>::DiscreteDbr(const AlgorithmSpec& spec)
    : spec_(spec),
      needs_(DualBehaviorNeeds(spec.config)),
      options_(PolicyLossOptions::Of(spec.config.dbr())),
      init_rng_(spec.seed),
      shape_(spec.observation_size, spec.hidden_sizes, spec.actions.size),
      runner_(UpdateThreads(spec.config)),
      policy_(shape_, spec.config.learning_rate(), /*with_target=*/true, init_rng_),
      critics_(shape_, spec.config.learning_rate(), init_rng_, &runner_),
      beta_plus_{
          TrainedNetwork<Scalar>(shape_, spec.config.learning_rate(), /*with_target=*/false, init_rng_),
          {},
          {}},
      beta_minus_{
          TrainedNetwork<Scalar>(shape_, spec.config.learning_rate(), /*with_target=*/false, init_rng_),
          {},
          {}},
      multiplier_(spec.config.dbr().first_multiplier(), spec.config.dbr().multiplier_learning_rate()),
      metrics_{{"train/critic_loss"},        {"train/actor_loss"},      {"train/beta_plus_loss"},
               {"train/beta_minus_loss"},    {"train/divergence_plus"}, {"train/divergence_minus"},
               {"train/threshold"},          {"train/multiplier"},      {"train/policy_entropy"},
               {"train/value_mean"},         {"train/target_mean"},     {"train/advantage_mean"},
               {"train/advantage_positive"}, {"train/advantage_std"}} {}

template <class Scalar>
absl::Status DiscreteDbr<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                                         const BasicBatch<Scalar>& minus) {
  SetLearningRate(LearningRate(spec_.config, updates_));
  runner_.Run([&] { FitBehavior(plus, &beta_plus_); }, [&] { FitBehavior(minus, &beta_minus_); });
  ComputeTargets(uniform);
  const Scalar critic_loss =
      critics_.Fit(uniform.observations, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
        return CriticLoss<Scalar>(q, uniform.actions, target_, d_q);
      });
  const PolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  ComputeAdvantages(uniform);
  multiplier_.Step(policy_loss.divergence_plus - policy_loss.threshold);
  critics_.UpdateTargets(spec_.config.target_tau());
  policy_.UpdateTarget(spec_.config.target_tau());
  ++updates_;
  return Report(critic_loss, policy_loss);
}

template <class Scalar>
void DiscreteDbr<Scalar>::SetLearningRate(double learning_rate) {
  policy_.set_learning_rate(learning_rate);
  critics_.set_learning_rate(learning_rate);
  beta_plus_.network.set_learning_rate(learning_rate);
  beta_minus_.network.set_learning_rate(learning_rate);
}

template <class Scalar>
void DiscreteDbr<Scalar>::FitBehavior(const BasicBatch<Scalar>& batch, Behavior* behavior) {
  if (batch.size() == 0) return;
  EvaluateBehavior(batch.observations, batch.masks, behavior);
  behavior->loss = NegativeLogLikelihood<Scalar>(behavior->distribution, batch.actions, &behavior->d_logits);
  behavior->network.Step(batch.observations, behavior->d_logits);
}

template <class Scalar>
void DiscreteDbr<Scalar>::EvaluateBehavior(const MatrixX<Scalar>& observations, const MatrixX<Scalar>& masks,
                                           Behavior* behavior) {
  MaskedSoftmax<Scalar>(behavior->network.Forward(observations), masks, &behavior->distribution);
}

template <class Scalar>
void DiscreteDbr<Scalar>::ComputeTargets(const BasicBatch<Scalar>& batch) {
  MaskedSoftmax<Scalar>(policy_.ForwardTarget(batch.next_observations), batch.next_masks, &next_pi_);
  const auto min_weight = static_cast<Scalar>(spec_.config.dbr().target_min_weight());
  critics_.EvaluateTargets(batch.next_observations);
  ExpectedTargetValue<Scalar>(next_pi_, critics_.target1(), critics_.target2(), min_weight, &target_);
  if (spec_.config.dbr().value_penalty()) {
    EvaluateBehavior(batch.next_observations, batch.next_masks, &beta_plus_);
    Divergence<Scalar>(options_.divergence, static_cast<Scalar>(options_.mmd_sigma), next_pi_,
                       beta_plus_.distribution, &penalty_, nullptr);
    target_ -= multiplier_.value() * penalty_;
  }
  const auto scale = static_cast<Scalar>(spec_.config.reward_scale());
  target_ = scale * batch.rewards + batch.discounts.cwiseProduct(target_);
}

template <class Scalar>
PolicyLoss<Scalar> DiscreteDbr<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  runner_.Run([&] { EvaluateBehavior(batch.observations, batch.masks, &beta_plus_); },
              [&] { EvaluateBehavior(batch.observations, batch.masks, &beta_minus_); });
  MaskedSoftmax<Scalar>(policy_.Forward(batch.observations), batch.masks, &pi_);
  options_.use_q = updates_ >= spec_.config.dbr().warm_start_updates();
  const PolicyLoss<Scalar> loss =
      DualBehaviorPolicyLoss<Scalar>(options_, pi_, critics_.q1(), critics_.q2(), beta_plus_.distribution,
                                     beta_minus_.distribution, multiplier_.value(), &workspace_, &d_logits_);
  policy_.Step(batch.observations, d_logits_);
  return loss;
}

template <class Scalar>
void DiscreteDbr<Scalar>::ComputeAdvantages(const BasicBatch<Scalar>& batch) {
  advantages_.resize(static_cast<std::size_t>(batch.size()));
  for (Eigen::Index j = 0; j < batch.size(); ++j) {
    const auto a = static_cast<Eigen::Index>(batch.actions(0, j));
    Scalar value = 0;
    for (Eigen::Index k = 0; k < pi_.probabilities.rows(); ++k) {
      value += pi_.probabilities(k, j) * std::min(critics_.q1()(k, j), critics_.q2()(k, j));
    }
    advantages_[static_cast<std::size_t>(j)] =
        static_cast<float>(std::min(critics_.q1()(a, j), critics_.q2()(a, j)) - value);
  }
}

template <class Scalar>
absl::Status DiscreteDbr<Scalar>::Report(Scalar critic_loss, const PolicyLoss<Scalar>& policy_loss) {
  const AdvantageFigures advantages = FiguresOf(advantages_);
  return SetMetrics(
      {critic_loss, policy_loss.loss, beta_plus_.loss, beta_minus_.loss, policy_loss.divergence_plus,
       policy_loss.divergence_minus, policy_loss.threshold, multiplier_.value(), policy_loss.entropy,
       policy_loss.value, target_.mean(), advantages.mean, advantages.positive, advantages.deviation},
      updates_, &metrics_);
}

template <class Scalar>
double DiscreteDbr<Scalar>::UpdateFlops() const {
  const double n = needs_.uniform;
  double flops = critics_.TargetFlops(needs_.uniform) + critics_.FitFlops(needs_.uniform);
  for (const int behavior : {needs_.plus, needs_.minus}) {
    flops += shape_.ForwardFlops(behavior) + shape_.ParameterGradientFlops(behavior);
  }
  flops += shape_.ForwardFlops(needs_.uniform) * (spec_.config.dbr().value_penalty() ? 2 : 1);  // at s'
  flops += 3 * shape_.ForwardFlops(needs_.uniform) + shape_.ParameterGradientFlops(n);          // at s
  return flops;
}

template <class Scalar>
void DiscreteDbr<Scalar>::ExportPolicy(PolicySnapshot* snapshot) const {
  BeginExport(spec_, snapshot);
  snapshot->support_epsilon = static_cast<float>(spec_.config.dbr().epsilon());
  ExportNetwork(kPolicyNetwork, policy_.parameters(), snapshot);
  ExportNetwork(kCritic1, critics_.first().parameters(), snapshot);
  ExportNetwork(kCritic2, critics_.second().parameters(), snapshot);
  ExportNetwork(kBetaPlus, beta_plus_.network.parameters(), snapshot);
  ExportNetwork(kBetaMinus, beta_minus_.network.parameters(), snapshot);
}

template <class Scalar>
void DiscreteDbr<Scalar>::Save(TensorFile* file) const {
  policy_.Save(kPolicyNetwork, file);
  critics_.Save(file);
  beta_plus_.network.Save(kBetaPlus, file);
  beta_minus_.network.Save(kBetaMinus, file);
  multiplier_.Save(file);
  PutCounter("dbr.updates", updates_, file);
}

template <class Scalar>
absl::Status DiscreteDbr<Scalar>::Load(const TensorFile& file) {
  absl::Status status = policy_.Load(kPolicyNetwork, file);
  status.Update(critics_.Load(file));
  status.Update(beta_plus_.network.Load(kBetaPlus, file));
  status.Update(beta_minus_.network.Load(kBetaMinus, file));
  status.Update(multiplier_.Load(file));
  status.Update(GetCounter("dbr.updates", file, &updates_));
  return status;
}

template class DiscreteDbr<float>;
template class DiscreteDbr<double>;

std::unique_ptr<Algorithm> MakeDiscreteDbr(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<DiscreteDbr>>(spec);
}

}  // namespace dbr
