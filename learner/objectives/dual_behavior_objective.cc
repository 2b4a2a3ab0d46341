#include "learner/objectives/dual_behavior_objective.h"

namespace dbr {

template <class Scalar>
PolicyLoss<Scalar> DualBehaviorObjective<Scalar>::Compute(const PolicyLossOptions& options,
                                                          const PolicyHeads<Scalar>& heads,
                                                          const MatrixX<Scalar>& observations,
                                                          const ObjectiveNoise<Scalar>& noise, Scalar alpha,
                                                          CriticEnsemble<Scalar>* critics,
                                                          MatrixX<Scalar>* d_output) {
  PolicyLoss<Scalar> result;
  const SoftPolicyLoss<Scalar> at_draws =
      q_objective_.Compute({.q = {.use_q = options.use_q, .normalize = options.normalize_q},
                            .entropy_weight = static_cast<Scalar>(options.entropy_weight)},
                           {heads.pi, observations, noise.actions}, critics, &gradient_);
  result.loss = at_draws.loss;
  result.value = at_draws.value;
  result.entropy = at_draws.entropy;
  AddConstraint(options, heads, noise, alpha, &result);
  heads.pi.Join(gradient_, d_output);
  return result;
}

template <class Scalar>
void DualBehaviorObjective<Scalar>::AddConstraint(const PolicyLossOptions& options,
                                                  const PolicyHeads<Scalar>& heads,
                                                  const ObjectiveNoise<Scalar>& noise, Scalar alpha,
                                                  PolicyLoss<Scalar>* result) {
  const GaussianDivergenceOptions kind{options.divergence, options.mmd_sigma};
  plus_.Compute(kind, heads.pi, heads.beta_plus, {noise.pi, noise.plus});
  result->divergence_plus = plus_.value().mean();
  Scalar limited_minus = 0;
  if (IsMovedByMinus(options.constraint)) {
    minus_.Compute(kind, heads.pi, heads.beta_minus, {noise.pi, noise.minus});
    result->divergence_minus = minus_.value().mean();
    if (options.limits_repulsion()) minus_.LimitTo(static_cast<Scalar>(options.max_repulsion));
    limited_minus = minus_.value().mean();
  }
  const Threshold<Scalar> threshold =
      ThresholdOf(options.constraint, static_cast<Scalar>(options.epsilon), limited_minus);
  result->threshold = threshold.value;
  if (options.constraint == DbrConfig::NONE) return;
  result->loss += alpha * (result->divergence_plus - threshold.value);
  const Scalar weight = alpha / static_cast<Scalar>(heads.pi.mean().cols());
  plus_.AddGradient(weight, &gradient_);
  if (options.repel_negative && threshold.moved_by_minus) minus_.AddGradient(-weight, &gradient_);
}

template class DualBehaviorObjective<float>;
template class DualBehaviorObjective<double>;

}  // namespace dbr
