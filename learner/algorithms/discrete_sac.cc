#include "learner/algorithms/discrete_sac.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/objectives/critic_target.h"
#include "learner/objectives/discrete_losses.h"

namespace dbr {
namespace {

constexpr int kSmaller = 1;  // a value takes the smaller twin alone

}  // namespace

template <class Scalar>
DiscreteSac<Scalar>::DiscreteSac(const AlgorithmSpec& spec)
    : Base(SoftNetworks<Scalar>::Metrics(), spec, spec.config.discrete_sac()) {}

template <class Scalar>
absl::Status DiscreteSac<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                         const BasicBatch<Scalar>&) {
  networks_.Begin();
  ComputeTarget(uniform);
  const Scalar critic_loss =
      networks_.critics.Fit(uniform.observations, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
        return CriticLoss<Scalar>(q, uniform.actions, target_, d_q);
      });
  const SoftPolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  const auto ratio = static_cast<Scalar>(networks_.spec.config.discrete_sac().target_entropy_ratio());
  networks_.Finish(policy_loss, ratio * MeanGreatestEntropy<Scalar>(uniform.masks));
  return networks_.Report(critic_loss, policy_loss, target_.mean(), &metrics_);
}

template <class Scalar>
void DiscreteSac<Scalar>::ComputeTarget(const BasicBatch<Scalar>& batch) {
  MaskedSoftmax<Scalar>(networks_.policy.Evaluate(batch.next_observations), batch.next_masks, &next_pi_);
  networks_.critics.EvaluateTargets(batch.next_observations);
  ExpectedTargetValue<Scalar>(next_pi_, networks_.critics.target1(), networks_.critics.target2(), kSmaller,
                              &next_value_);
  Entropy(next_pi_, &entropy_);
  next_value_ += networks_.temperature.value() * entropy_;
  CriticTarget(batch, networks_.spec.config.reward_scale(), next_value_, &target_);
}

// Improves the policy and sets the advantage of every transition.
template <class Scalar>
SoftPolicyLoss<Scalar> DiscreteSac<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const MatrixX<Scalar>&q1 = networks_.critics.q1(), &q2 = networks_.critics.q2();
  MaskedSoftmax<Scalar>(networks_.policy.Forward(batch.observations), batch.masks, &pi_);
  const SoftPolicyLoss<Scalar> loss =
      DiscreteSoftPolicyLoss<Scalar>(pi_, q1, q2, networks_.temperature.value(), &entropy_, &d_logits_);
  networks_.policy.Step(batch.observations, d_logits_);
  ExpectedTargetValue<Scalar>(pi_, q1, q2, kSmaller, &value_);
  ComputeAdvantages<Scalar>(q1, q2, batch.actions, value_, &networks_.advantages);
  return loss;
}

template class DiscreteSac<float>;
template class DiscreteSac<double>;

std::unique_ptr<Algorithm> MakeDiscreteSac(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<DiscreteSac>>(spec);
}

}  // namespace dbr
