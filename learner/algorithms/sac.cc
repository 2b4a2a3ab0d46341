#include "learner/algorithms/sac.h"

#include "learner/algorithms/algorithm_adapter.h"

namespace dbr {

template <class Scalar>
Sac<Scalar>::Sac(const AlgorithmSpec& spec)
    : spec_(spec),
      rng_(spec.seed),
      policy_shape_(spec.observation_size, spec.hidden_sizes, 2 * spec.actions.size),
      critic_shape_(spec.observation_size + spec.actions.size, spec.hidden_sizes, 1),
      networks_(spec, spec.config.sac(), policy_shape_, critic_shape_, rng_),
      target_entropy_(static_cast<Scalar>(spec.config.sac().target_entropy() * spec.actions.size)),
      metrics_(networks_.Metrics()) {}

template <class Scalar>
absl::Status Sac<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                 const BasicBatch<Scalar>&) {
  networks_.Begin(spec_.config);
  const Scalar critic_loss = FitCritics(uniform);
  const SoftPolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  networks_.Finish(spec_.config, policy_loss, target_entropy_);
  advantages_.resize(static_cast<std::size_t>(uniform.size()));
  Eigen::Map<Eigen::VectorXf>(advantages_.data(), uniform.size()) =
      (regression_.behavior_value() - value_).template cast<float>();
  return networks_.Report(critic_loss, policy_loss, regression_.target().mean(), advantages_, &metrics_);
}

template <class Scalar>
Scalar Sac<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  head_.Split(networks_.policy.Evaluate(batch.next_observations), kPolicyLogStd);
  FillNormal(rng_, spec_.actions.size, n, &noise_);
  next_draws_.Draw(head_, noise_);
  networks_.critics.EvaluateTargets(next_draws_.CriticInput(batch.next_observations));
  next_value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.target1(), networks_.critics.target2(), &next_value_);
  next_value_ -= networks_.temperature.value() * next_draws_.sample().log_prob;
  return regression_.Fit(batch, spec_.config.reward_scale(), next_value_, &networks_.critics);
}

template <class Scalar>
SoftPolicyLoss<Scalar> Sac<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  head_.Split(networks_.policy.Forward(batch.observations), kPolicyLogStd);
  FillNormal(rng_, spec_.actions.size, n, &noise_);
  const SoftPolicyLoss<Scalar> loss = objective_.Compute(
      head_, batch.observations, noise_, networks_.temperature.value(), &networks_.critics, &d_output_);
  networks_.policy.Step(batch.observations, d_output_);
  value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.value1(), networks_.critics.value2(), &value_);
  return loss;
}

template <class Scalar>
double Sac<Scalar>::UpdateFlops() const {
  const Eigen::Index n = needs().uniform;
  return networks_.UpdateFlops(n) + networks_.critics.InputGradientFlops(n);
}

template <class Scalar>
void Sac<Scalar>::ExportPolicy(PolicySnapshot* snapshot) const {
  networks_.Export(spec_, snapshot);
}

template <class Scalar>
void Sac<Scalar>::Save(TensorFile* file) const {
  networks_.Save(file);
  PutRng("sac.rng", rng_, file);
}

template <class Scalar>
absl::Status Sac<Scalar>::Load(const TensorFile& file) {
  absl::Status status = networks_.Load(file);
  status.Update(GetRng("sac.rng", file, &rng_));
  return status;
}

template class Sac<float>;
template class Sac<double>;

std::unique_ptr<Algorithm> MakeSac(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Sac>>(spec);
}

}  // namespace dbr
