#include "learner/objectives/dual_behavior_objective.h"

namespace dbr {

template <class Scalar>
PolicyLoss<Scalar> DualBehaviorObjective<Scalar>::Compute(
    const PolicyLossOptions& options, const PolicyHeads<Scalar>& heads, const MatrixX<Scalar>& observations,
    const TakenActions<Scalar>& taken, const ObjectiveNoise<Scalar>& noise, Scalar alpha,
    CriticEnsemble<Scalar>* critics, MatrixX<Scalar>* d_output) {
  PolicyLoss<Scalar> result;
  const SoftPolicyLoss<Scalar> at_draws =
      q_objective_.Compute({.q = {.use_q = options.use_q, .normalize = options.normalize_q},
                            .entropy_weight = static_cast<Scalar>(options.entropy_weight)},
                           {heads.pi, observations, noise.actions}, critics, &gradient_);
  result.loss = at_draws.loss;
  result.value = at_draws.value;
  result.entropy = at_draws.entropy;
  if (options.divergence == DbrConfig::ACTIONS) {
    MeasureActions(options, heads.pi, taken, *critics, &result);
  } else {
    Measure(options, heads, noise, &result);
  }
  AddConstraint(options, alpha, &result);
  heads.pi.Join(gradient_, d_output);
  return result;
}

template <class Scalar>
void DualBehaviorObjective<Scalar>::Measure(const PolicyLossOptions& options,
                                            const PolicyHeads<Scalar>& heads,
                                            const ObjectiveNoise<Scalar>& noise, PolicyLoss<Scalar>* result) {
  const GaussianDivergenceOptions kind{options.divergence, options.mmd_sigma};
  plus_.Compute(kind, heads.pi, heads.beta_plus, {noise.pi, noise.plus});
  result->divergence_plus = plus_.value().mean();
  if (!IsMovedByMinus(options.constraint)) return;
  minus_.Compute(kind, heads.pi, heads.beta_minus, {noise.pi, noise.minus});
  result->divergence_minus = minus_.value().mean();
  if (options.limits_repulsion()) minus_.LimitTo(static_cast<Scalar>(options.max_repulsion));
}

template <class Scalar>
void DualBehaviorObjective<Scalar>::MeasureActions(const PolicyLossOptions& options,
                                                   const GaussianHead<Scalar>& pi,
                                                   const TakenActions<Scalar>& taken,
                                                   const CriticEnsemble<Scalar>& critics,
                                                   PolicyLoss<Scalar>* result) {
  advantage_.resize(pi.mean().cols());
  StateValue(critics, &advantage_);
  advantage_ = taken.values - advantage_;
  WeighActions<Scalar>(options.actions, advantage_, &plus_weights_, &minus_weights_);
  plus_.ComputeToActions(pi, taken.actions);
  minus_ = plus_;
  const Scalar in_minus = minus_weights_.sum();
  result->divergence_minus = in_minus == 0 ? Scalar{0} : minus_weights_.dot(minus_.value()) / in_minus;
  if (options.limits_repulsion()) minus_.LimitTo(static_cast<Scalar>(options.max_repulsion));
  minus_.WeightBy(minus_weights_);
  plus_.WeightBy(plus_weights_);
  result->divergence_plus = plus_.value().mean();
}

template <class Scalar>
void DualBehaviorObjective<Scalar>::AddConstraint(const PolicyLossOptions& options, Scalar alpha,
                                                  PolicyLoss<Scalar>* result) {
  const Scalar limited_minus = IsMovedByMinus(options.constraint) ? minus_.value().mean() : Scalar{0};
  const Threshold<Scalar> threshold =
      ThresholdOf(options.constraint, static_cast<Scalar>(options.epsilon), limited_minus);
  result->threshold = threshold.value;
  if (options.constraint == DbrConfig::NONE) return;
  result->loss += alpha * (result->divergence_plus - threshold.value);
  const Scalar weight = alpha / static_cast<Scalar>(gradient_.mean.cols());
  plus_.AddGradient(weight, &gradient_);
  if (options.repel_negative && threshold.moved_by_minus) minus_.AddGradient(-weight, &gradient_);
}

template class DualBehaviorObjective<float>;
template class DualBehaviorObjective<double>;

}  // namespace dbr
