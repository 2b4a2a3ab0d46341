#include "learner/algorithms/discrete_bear.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/objectives/critic_target.h"

namespace dbr {

template <class Scalar>
DiscreteBear<Scalar>::DiscreteBear(const AlgorithmSpec& spec)
    : Base(BearNetworks<Scalar>::Metrics(), spec),
      options_(PolicyLossOptions::Of(spec.config.bear())),
      behavior_(networks_.policy.shape(), networks_.Options(spec, /*with_target=*/false), networks_.rng) {}

template <class Scalar>
absl::Status DiscreteBear<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                          const BasicBatch<Scalar>&) {
  behavior_.set_learning_rate(networks_.Begin());
  networks_.runner.Run([&] { beta_.Fit(uniform, nullptr, &behavior_); },
                       [&] {
                         MaskedSoftmax<Scalar>(networks_.policy.ForwardTarget(uniform.next_observations),
                                               uniform.next_masks, &next_pi_);
                         MaskedSoftmax<Scalar>(networks_.policy.Forward(uniform.observations), uniform.masks,
                                               &pi_);
                       });
  const Scalar critic_loss = FitCritics(uniform);
  const ConstrainedLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  ExpectedTargetValue<Scalar>(pi_, networks_.critics.q1(), networks_.critics.q2(), /*min_weight=*/1, &value_);
  ComputeAdvantages<Scalar>(networks_.critics.q1(), networks_.critics.q2(), uniform.actions, value_,
                            &networks_.advantages);
  networks_.Finish(policy_loss);
  return networks_.Report({critic_loss, beta_.loss()}, policy_loss, target_.mean(), &metrics_);
}

template <class Scalar>
Scalar DiscreteBear<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  networks_.critics.EvaluateTargets(batch.next_observations);
  ExpectedTargetValue<Scalar>(next_pi_, networks_.critics.target1(), networks_.critics.target2(),
                              static_cast<Scalar>(networks_.spec.config.bear().target_min_weight()),
                              &target_);
  CriticTarget(batch, networks_.spec.config.reward_scale(), target_, &target_);
  return networks_.critics.Fit(batch.observations, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
    return CriticLoss<Scalar>(q, batch.actions, target_, d_q);
  });
}

template <class Scalar>
ConstrainedLoss<Scalar> DiscreteBear<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  options_.use_q = networks_.UseQ();
  const ConstrainedLoss<Scalar> loss = ConstrainedPolicyLoss<Scalar>(
      options_, {pi_, networks_.critics.q1(), networks_.critics.q2()},
      {beta_.distribution(), static_cast<Scalar>(options_.epsilon), networks_.multiplier.value()},
      &workspace_, &d_logits_);
  networks_.policy.Step(batch.observations, d_logits_);
  return loss;
}

template <class Scalar>
double DiscreteBear<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  // The forward passes of beta, pi' and pi, and the steps of beta and pi.
  const MlpShape& shape = networks_.policy.shape();
  return 3 * shape.ForwardFlops(n) + 2 * shape.ParameterGradientFlops(n) + networks_.critics.TargetFlops(n) +
         networks_.critics.FitFlops(n);
}

template <class Scalar>
void DiscreteBear<Scalar>::ExportPolicy(PolicySnapshot* snapshot) const {
  networks_.Export(snapshot);
  ExportNetwork(kBehavior, behavior_.parameters(), snapshot);
}

template <class Scalar>
void DiscreteBear<Scalar>::Save(TensorFile* file) const {
  networks_.Save(file);
  behavior_.Save(kBehavior, file);
}

template <class Scalar>
absl::Status DiscreteBear<Scalar>::Load(const TensorFile& file) {
  absl::Status status = networks_.Load(file);
  status.Update(behavior_.Load(kBehavior, file));
  return status;
}

template class DiscreteBear<float>;
template class DiscreteBear<double>;

std::unique_ptr<Algorithm> MakeDiscreteBear(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<DiscreteBear>>(spec);
}

}  // namespace dbr
