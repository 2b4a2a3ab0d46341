#include "learner/algorithms/awac.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/objectives/advantage_weights.h"
#include "learner/training/update_metrics.h"

namespace dbr {

template <class Scalar>
Awac<Scalar>::Awac(const AlgorithmSpec& spec)
    : Base({{"train/critic_loss"},
            {"train/actor_loss"},
            {"train/weight_mean"},
            {"train/weight_max"},
            {"train/policy_entropy"},
            {"train/value_mean"},
            {"train/target_mean"},
            {"train/advantage_mean"},
            {"train/advantage_positive"},
            {"train/advantage_std"}},
           spec) {}

template <class Scalar>
absl::Status Awac<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                  const BasicBatch<Scalar>&) {
  networks_.Begin();
  ComputeValue(uniform);
  const Scalar critic_loss = FitCritics(uniform);
  advantage_ = regression_.behavior_value() - value_;
  networks_.SetAdvantages(advantage_);
  AdvantageWeights<Scalar>(advantage_, {config().temperature(), config().max_weight()}, &weights_);
  pi_.Step(uniform, &weights_, &networks_.policy);
  ++networks_.updates;
  const AdvantageFigures advantages = FiguresOf(networks_.advantages);
  return SetMetrics({critic_loss, pi_.loss(), weights_.mean(), weights_.maxCoeff(),
                     -draws_.sample().log_prob.mean(), value_.mean(), regression_.target().mean(),
                     advantages.mean, advantages.positive, advantages.deviation},
                    networks_.updates, &metrics_);
}

template <class Scalar>
void Awac<Scalar>::ComputeValue(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  const GaussianHead<Scalar>& head = pi_.Forward(batch.observations, &networks_.policy);
  FillNormal(networks_.rng, networks_.spec.actions.size, config().value_samples() * n, &noise_);
  draws_.Draw(head, noise_);
  networks_.critics.Evaluate(draws_.CriticInput(batch.observations));
  value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.value1(), networks_.critics.value2(), &value_);
}

template <class Scalar>
Scalar Awac<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  CriticEnsemble<Scalar>& critics = networks_.critics;
  next_pi_.Split(networks_.policy.Evaluate(batch.next_observations), kBehaviorLogStd);
  FillNormal(networks_.rng, networks_.spec.actions.size, n, &next_noise_);
  next_draws_.DrawActions(next_pi_, next_noise_);
  critics.EvaluateTargets(next_draws_.CriticInput(batch.next_observations));
  next_value_.resize(n);
  MeanOfSmaller<Scalar>(critics.target1(), critics.target2(), &next_value_);
  return regression_.Fit(batch, networks_.spec.config.reward_scale(), next_value_, &critics);
}

template <class Scalar>
double Awac<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  const MlpShape& policy = networks_.policy.shape();
  return critics.TargetFlops(n) + critics.TargetFlops(n * config().value_samples()) + critics.FitFlops(n) +
         2 * policy.ForwardFlops(n) + policy.ParameterGradientFlops(n);
}

template class Awac<float>;
template class Awac<double>;

std::unique_ptr<Algorithm> MakeAwac(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Awac>>(spec);
}

}  // namespace dbr
