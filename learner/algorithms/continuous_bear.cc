#include "learner/algorithms/continuous_bear.h"

#include "absl/strings/str_cat.h"
#include "learner/algorithms/algorithm_adapter.h"

namespace dbr {
namespace {

CvaeShape VaeShape(const AlgorithmSpec& spec) {
  const auto& sizes = spec.config.bear().vae_hidden_sizes();
  std::vector<int> hidden(sizes.begin(), sizes.end());
  if (hidden.empty()) hidden = {750, 750};
  return CvaeShape(spec.observation_size, spec.actions.size, hidden);
}

}  // namespace

template <class Scalar>
ContinuousBear<Scalar>::ContinuousBear(const AlgorithmSpec& spec)
    : Base(BearNetworks<Scalar>::Metrics(), spec),
      options_(PolicyLossOptions::Of(spec.config.bear())),
      vae_(VaeShape(spec), networks_.Options(spec, /*with_target=*/false), networks_.rng) {}

template <class Scalar>
absl::Status ContinuousBear<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                            const BasicBatch<Scalar>&) {
  vae_.set_learning_rate(networks_.Begin());
  const Scalar behavior_loss = FitBehavior(uniform);
  networks_.runner.Run([&] { next_.EvaluatePolicy(uniform.next_observations, &networks_.policy); },
                       [&] { pi_.Split(networks_.policy.Forward(uniform.observations), kPolicyLogStd); });
  const Scalar critic_loss = FitCritics(uniform);
  const ConstrainedLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  networks_.SetAdvantages(regression_.behavior_value() - value_);
  networks_.Finish(policy_loss);
  return networks_.Report({critic_loss, behavior_loss}, policy_loss, regression_.target().mean(), &metrics_);
}

template <class Scalar>
Scalar ContinuousBear<Scalar>::FitBehavior(const BasicBatch<Scalar>& batch) {
  FillNormal(networks_.rng, vae_.shape().latent_size, batch.size(), &vae_noise_);
  return vae_
      .Fit({batch.observations, batch.actions, vae_noise_}, static_cast<Scalar>(config().vae_kl_weight()))
      .loss;
}

template <class Scalar>
Scalar ContinuousBear<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  FillNormal(networks_.rng, networks_.spec.actions.size, config().target_samples() * batch.size(),
             &next_noise_);
  const VectorX<Scalar>& next_value =
      next_.Compute(batch.next_observations, next_noise_, static_cast<Scalar>(config().target_min_weight()),
                    &networks_.critics);
  return regression_.Fit(batch, networks_.spec.config.reward_scale(), next_value, &networks_.critics);
}

template <class Scalar>
ConstrainedLoss<Scalar> ContinuousBear<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size(), samples = config().divergence_samples();
  FillNormal(networks_.rng, networks_.spec.actions.size, config().policy_samples() * n, &action_noise_);
  FillNormal(networks_.rng, networks_.spec.actions.size, samples * n, &divergence_noise_);
  FillNormal(networks_.rng, vae_.shape().latent_size, samples * n, &latent_noise_);
  const MatrixX<Scalar>& behavior =
      vae_.Sample(batch.observations, latent_noise_, static_cast<Scalar>(config().vae_latent_limit()));
  options_.use_q = networks_.UseQ();
  const ConstrainedLoss<Scalar> loss =
      objective_.Compute(options_, {{pi_, batch.observations, action_noise_}, divergence_noise_, behavior},
                         networks_.multiplier.value(), &networks_.critics, &d_output_);
  networks_.policy.Step(batch.observations, d_output_);
  value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.value1(), networks_.critics.value2(), &value_);
  return loss;
}

template <class Scalar>
double ContinuousBear<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  const MlpShape& policy = networks_.policy.shape();
  return vae_.shape().GradientFlops(n) + vae_.shape().DecodeFlops(n * config().divergence_samples()) +
         critics.TargetFlops(n * config().target_samples()) + critics.FitFlops(n) +
         critics.InputGradientFlops(n * config().policy_samples()) + 2 * policy.ForwardFlops(n) +
         policy.ParameterGradientFlops(n);
}

template <class Scalar>
void ContinuousBear<Scalar>::Save(TensorFile* file) const {
  networks_.Save(file);
  vae_.Save(file);
}

template <class Scalar>
absl::Status ContinuousBear<Scalar>::Load(const TensorFile& file) {
  absl::Status status = networks_.Load(file);
  status.Update(vae_.Load(file));
  return status;
}

template class ContinuousBear<float>;
template class ContinuousBear<double>;

absl::Status CheckContinuousBear(const AlgorithmConfig& config, const std::string& env) {
  const DbrConfig::Divergence divergence = config.bear().divergence();
  if (IsSampled(divergence)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "algorithm.bear.divergence: expected MMD_LAPLACIAN or MMD_GAUSSIAN for the continuous actions of '",
      env, "', found ", DbrConfig::Divergence_Name(divergence),
      ". The behaviour model is a VAE, which gives samples and no density: set one of the two."));
}

std::unique_ptr<Algorithm> MakeContinuousBear(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<ContinuousBear>>(spec);
}

}  // namespace dbr
