#include "learner/algorithms/td3.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/training/update_metrics.h"

namespace dbr {

template <class Scalar>
Td3<Scalar>::Td3(const AlgorithmSpec& spec)
    : Base({{"train/critic_loss"},
            {"train/actor_loss"},
            {"train/action_distance"},
            {"train/value_mean"},
            {"train/target_mean"},
            {"train/advantage_mean"},
            {"train/advantage_positive"},
            {"train/advantage_std"}},
           spec),
      terms_(Td3Terms::Of(spec)) {
  VectorX<Scalar> parameters = networks_.policy.parameters();
  PinLogStd(networks_.policy.shape(), &parameters);
  networks_.policy.SetParameters(parameters);
}

template <class Scalar>
absl::Status Td3<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                 const BasicBatch<Scalar>&) {
  networks_.Begin(/*move_targets=*/ImprovesPolicy());
  const Scalar critic_loss = FitCritics(uniform);
  const Scalar policy_loss = ImprovePolicy(uniform);
  ++networks_.updates;
  const AdvantageFigures advantages = FiguresOf(networks_.advantages);
  return SetMetrics({critic_loss, policy_loss, objective_.distance(), value_.mean(),
                     regression_.target().mean(), advantages.mean, advantages.positive, advantages.deviation},
                    networks_.updates, &metrics_);
}

template <class Scalar>
Scalar Td3<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  CriticEnsemble<Scalar>& critics = networks_.critics;
  next_pi_.Split(networks_.policy.ForwardTarget(batch.next_observations), kPolicyLogStd);
  FillNormal(networks_.rng, networks_.spec.actions.size, n, &noise_);
  SmoothedActions<Scalar>(next_pi_.mean(), noise_, terms_.smoothing, &next_actions_);
  next_inputs_.resize(batch.observations.rows() + next_actions_.rows(), n);
  next_inputs_ << batch.next_observations, next_actions_;
  critics.EvaluateTargets(next_inputs_);
  next_value_.resize(n);
  MeanOfSmaller<Scalar>(critics.target1(), critics.target2(), &next_value_);
  if (terms_.critic_penalty > 0) {
    next_value_ -= static_cast<Scalar>(terms_.critic_penalty) *
                   (next_actions_ - batch.next_actions).colwise().squaredNorm().transpose();
  }
  return regression_.Fit(batch, networks_.spec.config.reward_scale(), next_value_, &critics);
}

template <class Scalar>
Scalar Td3<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  CriticEnsemble<Scalar>& critics = networks_.critics;
  pi_.Split(networks_.policy.Forward(batch.observations), kPolicyLogStd);
  const Scalar loss = objective_.Evaluate(terms_.policy, pi_, batch, &critics);
  value_.resize(batch.size());
  MeanOfSmaller<Scalar>(critics.value1(), critics.value2(), &value_);
  networks_.SetAdvantages(regression_.behavior_value() - value_);
  if (!ImprovesPolicy()) return loss;
  objective_.Gradient(pi_, &critics, &d_output_);
  networks_.policy.Step(batch.observations, d_output_);
  return loss;
}

template <class Scalar>
double Td3<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  const MlpShape& policy = networks_.policy.shape();
  const double delayed = critics.FirstInputGradientFlops(n) + policy.ParameterGradientFlops(n);
  // The targets of the critics at s' and the critics at pi(s) cost the same. The policy is evaluated as pi'
  // at s' and as pi at s.
  return critics.FitFlops(n) + 2 * critics.TargetFlops(n) + 2 * policy.ForwardFlops(n) +
         delayed / terms_.policy_delay;
}

template class Td3<float>;
template class Td3<double>;

std::unique_ptr<Algorithm> MakeTd3(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Td3>>(spec);
}

}  // namespace dbr
