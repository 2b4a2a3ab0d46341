#include "learner/parts/dual_behavior_objective.h"

namespace dbr {

template <class Scalar>
PolicyLoss<Scalar> DualBehaviorObjective<Scalar>::Compute(const PolicyLossOptions& options,
                                                          const PolicyHeads<Scalar>& heads,
                                                          const MatrixX<Scalar>& observations,
                                                          const ObjectiveNoise<Scalar>& noise, Scalar alpha,
                                                          TwinCritic<Scalar>* critics,
                                                          MatrixX<Scalar>* d_output) {
  PolicyLoss<Scalar> result;
  gradient_.mean.setZero(heads.pi.mean().rows(), heads.pi.mean().cols());
  gradient_.log_std.setZero(heads.pi.mean().rows(), heads.pi.mean().cols());
  AddQTerm(options, heads, observations, noise, critics, &result);
  AddConstraint(options, heads, noise, alpha, &result);
  heads.pi.Join(gradient_, d_output);
  return result;
}

template <class Scalar>
void DualBehaviorObjective<Scalar>::AddQTerm(const PolicyLossOptions& options,
                                             const PolicyHeads<Scalar>& heads,
                                             const MatrixX<Scalar>& observations,
                                             const ObjectiveNoise<Scalar>& noise, TwinCritic<Scalar>* critics,
                                             PolicyLoss<Scalar>* result) {
  samples_.Draw(heads.pi, noise.actions);
  critics->Evaluate(samples_.CriticInput(observations));
  SmallerMeanQTerm<Scalar>({.use_q = options.use_q, .normalize = options.normalize_q}, critics->value1(),
                           critics->value2(), observations.cols(), &q_term_);
  const VectorX<Scalar>& log_prob = samples_.sample().log_prob;
  const auto entropy_weight = static_cast<Scalar>(options.entropy_weight);
  d_log_prob_.setConstant(log_prob.size(), entropy_weight / static_cast<Scalar>(log_prob.size()));
  samples_.Backprop(critics->InputGradient(q_term_.d_q1, q_term_.d_q2), d_log_prob_, &gradient_);
  result->value = q_term_.value;
  result->entropy = -log_prob.mean();
  result->loss += q_term_.loss - entropy_weight * result->entropy;
}

template <class Scalar>
void DualBehaviorObjective<Scalar>::AddConstraint(const PolicyLossOptions& options,
                                                  const PolicyHeads<Scalar>& heads,
                                                  const ObjectiveNoise<Scalar>& noise, Scalar alpha,
                                                  PolicyLoss<Scalar>* result) {
  const GaussianDivergenceOptions kind{options.divergence, options.mmd_sigma};
  plus_.Compute(kind, heads.pi, heads.beta_plus, {noise.pi, noise.plus});
  minus_.Compute(kind, heads.pi, heads.beta_minus, {noise.pi, noise.minus});
  result->divergence_plus = plus_.value().mean();
  result->divergence_minus = minus_.value().mean();
  const Threshold<Scalar> threshold =
      ThresholdOf(options.constraint, static_cast<Scalar>(options.epsilon), result->divergence_minus);
  result->threshold = threshold.value;
  result->loss += alpha * (result->divergence_plus - threshold.value);
  const Scalar weight = alpha / static_cast<Scalar>(heads.pi.mean().cols());
  gradient_.mean += weight * plus_.gradient().mean;
  gradient_.log_std += weight * plus_.gradient().log_std;
  if (!options.repel_negative || !threshold.moved_by_minus) return;
  gradient_.mean -= weight * minus_.gradient().mean;
  gradient_.log_std -= weight * minus_.gradient().log_std;
}

template class DualBehaviorObjective<float>;
template class DualBehaviorObjective<double>;

}  // namespace dbr
