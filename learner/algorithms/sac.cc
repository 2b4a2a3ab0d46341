#include "learner/algorithms/sac.h"

#include "learner/algorithms/algorithm_adapter.h"

namespace dbr {

template <class Scalar>
Sac<Scalar>::Sac(const AlgorithmSpec& spec)
    : Base(SoftNetworks<Scalar>::Metrics(), spec, spec.config.sac()),
      target_entropy_(static_cast<Scalar>(spec.config.sac().target_entropy() * spec.actions.size)) {}

template <class Scalar>
absl::Status Sac<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                 const BasicBatch<Scalar>&) {
  networks_.Begin();
  EvaluatePolicy(uniform);
  const Scalar critic_loss = FitCritics(uniform);
  const bool improves =
      (networks_.updates + 1) % networks_.spec.config.sac().updates_per_policy_update() == 0;
  ImprovePolicy(uniform, improves);
  networks_.Finish(policy_loss_, target_entropy_, improves);
  networks_.SetAdvantages(regression_.behavior_value() - value_);
  return networks_.Report(critic_loss, policy_loss_, regression_.target().mean(), &metrics_);
}

template <class Scalar>
void Sac<Scalar>::EvaluatePolicy(const BasicBatch<Scalar>& batch) {
  networks_.runner.Run(
      [&] { next_head_.Split(networks_.policy.Evaluate(batch.next_observations), kPolicyLogStd); },
      [&] { head_.Split(networks_.policy.Forward(batch.observations), kPolicyLogStd); });
}

template <class Scalar>
Scalar Sac<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  FillNormal(networks_.rng, networks_.spec.actions.size, n, &noise_);
  next_draws_.Draw(next_head_, noise_);
  networks_.critics.EvaluateTargets(next_draws_.CriticInput(batch.next_observations));
  next_value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.target1(), networks_.critics.target2(), &next_value_);
  next_value_ -= networks_.temperature.value() * next_draws_.sample().log_prob;
  return regression_.Fit(batch, networks_.spec.config.reward_scale(), next_value_, &networks_.critics);
}

template <class Scalar>
void Sac<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch, bool improves) {
  const Eigen::Index n = batch.size();
  FillNormal(networks_.rng, networks_.spec.actions.size, n, &noise_);
  if (improves) {
    policy_loss_ = objective_.Compute(head_, batch.observations, noise_, networks_.temperature.value(),
                                      &networks_.critics, &d_output_);
    networks_.policy.Step(batch.observations, d_output_);
  } else {
    objective_.Evaluate({head_, batch.observations, noise_}, &networks_.critics);
  }
  value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.value1(), networks_.critics.value2(), &value_);
}

template <class Scalar>
double Sac<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  const double improving = 1.0 / networks_.spec.config.sac().updates_per_policy_update();
  return networks_.UpdateFlops(n, improving) + critics.TargetFlops(n) +
         improving * critics.FirstInputGradientFlops(n);
}

template class Sac<float>;
template class Sac<double>;

std::unique_ptr<Algorithm> MakeSac(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Sac>>(spec);
}

}  // namespace dbr
