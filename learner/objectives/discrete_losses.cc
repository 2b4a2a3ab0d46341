#include "learner/objectives/discrete_losses.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "nn/divergence.h"
#include "nn/keep_nan.h"

namespace dbr {
namespace {

// Adds -E[min_i sum_a pi Q_i] / scale to the loss. Adds its gradient with respect to pi's probabilities to
// `gradient`. Returns the scale.
template <class Scalar>
Scalar AddQTerm(const PolicyLossOptions& options, const ValuedPolicy<Scalar>& at,
                ConstrainedLoss<Scalar>* result, MatrixX<Scalar>* gradient) {
  const auto& [policy, q1, q2] = at;
  const Eigen::Index n = q1.cols();
  Scalar sum = 0, size = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    const Scalar value1 = policy.probabilities.col(j).dot(q1.col(j));
    const Scalar value2 = policy.probabilities.col(j).dot(q2.col(j));
    const auto smaller = value1 <= value2 ? q1.col(j) : q2.col(j);
    sum += SmallerOrNan(value1, value2);
    size += policy.probabilities.col(j).dot(smaller.cwiseAbs());
    gradient->col(j) -= smaller;
  }
  result->value = sum / static_cast<Scalar>(n);
  if (!options.use_q) {
    gradient->setZero();
    return 1;
  }
  const Scalar mean_size = size / static_cast<Scalar>(n);
  const Scalar scale = options.normalize_q ? std::max(mean_size, Scalar{1e-6}) : Scalar{1};
  *gradient /= scale * static_cast<Scalar>(n);
  result->loss -= result->value / scale;
  return scale;
}

// Returns the mean entropy of the policy. Adds the gradient of -weight times the mean entropy, with respect
// to pi's probabilities, to `gradient`. The missing +1 of log pi + 1 vanishes in SoftmaxGradient.
template <class Scalar>
Scalar AddEntropyTerm(const Categorical<Scalar>& policy, Scalar weight, VectorX<Scalar>* entropy,
                      MatrixX<Scalar>* gradient) {
  Entropy(policy, entropy);
  *gradient += weight / static_cast<Scalar>(entropy->size()) * policy.log_probabilities;
  return entropy->mean();
}

// Cuts each divergence [n] at `limit`. The gradient of a state beyond it becomes 0.
template <class Scalar>
void LimitDivergence(Scalar limit, VectorX<Scalar>* divergence, MatrixX<Scalar>* gradient) {
  for (Eigen::Index j = 0; j < divergence->size(); ++j) {
    if (!((*divergence)[j] > limit)) continue;
    (*divergence)[j] = limit;
    gradient->col(j).setZero();
  }
}

}  // namespace

template <class Scalar>
void ExpectedTargetValue(const Categorical<Scalar>& policy, const ConstMatrixRef<Scalar>& q1,
                         const ConstMatrixRef<Scalar>& q2, Scalar min_weight, VectorX<Scalar>* value) {
  // The greater twin may drop a NaN: the smaller one has it, at any weight.
  *value = (policy.probabilities.array() *
            (min_weight * EachSmallerOrNan(q1, q2).array() + (1 - min_weight) * q1.array().max(q2.array())))
               .colwise()
               .sum()
               .transpose();
}

template <class Scalar>
void GreedyValue(const ConstMatrixRef<Scalar>& chooser, const ConstMatrixRef<Scalar>& judge,
                 const ConstMatrixRef<Scalar>& masks, VectorX<Scalar>* value) {
  value->resize(chooser.cols());
  for (Eigen::Index j = 0; j < chooser.cols(); ++j) {
    Eigen::Index best = -1;
    Scalar greatest = 0;
    for (Eigen::Index k = 0; k < chooser.rows(); ++k) {
      if (masks(k, j) <= 0) continue;
      greatest = best < 0 ? chooser(k, j) : GreaterOrNan(greatest, chooser(k, j));
      if (best < 0 || chooser(k, j) > chooser(best, j)) best = k;
    }
    const Scalar chosen = best < 0 ? Scalar{0} : judge(best, j);
    (*value)[j] = std::isnan(greatest) ? greatest : chosen;
  }
}

template <class Scalar>
void ComputeAdvantages(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                       const ConstMatrixRef<Scalar>& actions, const VectorX<Scalar>& value,
                       std::vector<float>* advantages) {
  advantages->resize(static_cast<std::size_t>(q1.cols()));
  for (Eigen::Index j = 0; j < q1.cols(); ++j) {
    const auto a = static_cast<Eigen::Index>(actions(0, j));
    (*advantages)[static_cast<std::size_t>(j)] =
        static_cast<float>(SmallerOrNan(q1(a, j), q2(a, j)) - value[j]);
  }
}

template <class Scalar>
Scalar CriticLoss(const ConstMatrixRef<Scalar>& q, const ConstMatrixRef<Scalar>& actions,
                  const VectorX<Scalar>& y, MatrixX<Scalar>* d_q) {
  const Eigen::Index n = q.cols();
  d_q->resize(q.rows(), n);
  d_q->setZero();
  Scalar loss = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto a = static_cast<Eigen::Index>(actions(0, j));
    const Scalar error = q(a, j) - y[j];
    loss += error * error;
    (*d_q)(a, j) = 2 * error / static_cast<Scalar>(n);
  }
  return loss / static_cast<Scalar>(n);
}

template <class Scalar>
void Divergence(DbrConfig::Divergence kind, Scalar mmd_sigma, const Categorical<Scalar>& p,
                const Categorical<Scalar>& q, VectorX<Scalar>* divergence, MatrixX<Scalar>* d_probabilities) {
  if (kind == DbrConfig::KL) {
    KlDivergence(p, q, divergence);
    if (d_probabilities != nullptr) *d_probabilities = p.log_probabilities - q.log_probabilities;
    return;
  }
  const auto mmd = kind == DbrConfig::MMD_SQUARED ? SquaredCategoricalMmd<Scalar> : CategoricalMmd<Scalar>;
  mmd(p.probabilities, q.probabilities, mmd_sigma, divergence, d_probabilities);
}

template <class Scalar>
ConstrainedLoss<Scalar> ConstrainedPolicyLoss(const PolicyLossOptions& options,
                                              const ValuedPolicy<Scalar>& at,
                                              const BehaviorConstraint<Scalar>& constraint,
                                              PolicyLossWorkspace<Scalar>* workspace,
                                              MatrixX<Scalar>* d_logits) {
  ConstrainedLoss<Scalar> result;
  const Categorical<Scalar>& policy = at.policy;
  const auto n = static_cast<Scalar>(policy.probabilities.cols());
  d_logits->setZero(policy.probabilities.rows(), policy.probabilities.cols());
  const Scalar scale = AddQTerm(options, at, &result, d_logits);

  Divergence(options.divergence, static_cast<Scalar>(options.mmd_sigma), policy, constraint.beta,
             &workspace->plus, &workspace->d_plus);
  result.divergence = workspace->plus.mean();
  result.threshold = constraint.threshold;
  result.loss += constraint.alpha * (result.divergence - result.threshold);
  *d_logits += constraint.alpha / n * workspace->d_plus;

  const auto entropy_weight = options.use_q ? static_cast<Scalar>(options.entropy_weight) / scale : Scalar{0};
  result.entropy = AddEntropyTerm(policy, entropy_weight, &workspace->entropy, d_logits);
  result.loss -= entropy_weight * result.entropy;
  SoftmaxGradient(policy, d_logits);
  return result;
}

template <class Scalar>
PolicyLoss<Scalar> DualBehaviorPolicyLoss(const PolicyLossOptions& options, const Categorical<Scalar>& policy,
                                          const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                                          const Categorical<Scalar>& beta_plus,
                                          const Categorical<Scalar>& beta_minus, Scalar alpha,
                                          PolicyLossWorkspace<Scalar>* workspace, MatrixX<Scalar>* d_logits) {
  Scalar divergence_minus = 0, limited_minus = 0;
  if (IsMovedByMinus(options.constraint)) {
    Divergence(options.divergence, static_cast<Scalar>(options.mmd_sigma), policy, beta_minus,
               &workspace->minus, &workspace->d_minus);
    divergence_minus = workspace->minus.mean();
    if (options.limits_repulsion()) {
      LimitDivergence(static_cast<Scalar>(options.max_repulsion), &workspace->minus, &workspace->d_minus);
    }
    limited_minus = workspace->minus.mean();
  }
  const Threshold<Scalar> threshold =
      ThresholdOf(options.constraint, static_cast<Scalar>(options.epsilon), limited_minus);
  const Scalar weight = options.constraint == DbrConfig::NONE ? Scalar{0} : alpha;
  const ConstrainedLoss<Scalar> loss = ConstrainedPolicyLoss<Scalar>(
      options, {policy, q1, q2}, {beta_plus, threshold.value, weight}, workspace, d_logits);
  if (options.repel_negative && threshold.moved_by_minus) {
    SoftmaxGradient(policy, &workspace->d_minus);
    *d_logits -= alpha / static_cast<Scalar>(policy.probabilities.cols()) * workspace->d_minus;
  }
  return {.loss = loss.loss,
          .value = loss.value,
          .divergence_plus = loss.divergence,
          .divergence_minus = divergence_minus,
          .threshold = loss.threshold,
          .entropy = loss.entropy};
}

template <class Scalar>
SoftPolicyLoss<Scalar> DiscreteSoftPolicyLoss(const Categorical<Scalar>& policy,
                                              const ConstMatrixRef<Scalar>& q1,
                                              const ConstMatrixRef<Scalar>& q2, Scalar temperature,
                                              VectorX<Scalar>* entropy, MatrixX<Scalar>* d_logits) {
  SoftPolicyLoss<Scalar> result;
  const auto n = static_cast<Scalar>(q1.cols());
  *d_logits = -EachSmallerOrNan(q1, q2) / n;
  result.value = -policy.probabilities.cwiseProduct(*d_logits).sum();
  result.entropy = AddEntropyTerm(policy, temperature, entropy, d_logits);
  result.loss = -result.value - temperature * result.entropy;
  SoftmaxGradient(policy, d_logits);
  return result;
}

template <class Scalar>
Scalar MeanGreatestEntropy(const ConstMatrixRef<Scalar>& masks) {
  Scalar sum = 0;
  for (Eigen::Index j = 0; j < masks.cols(); ++j) {
    const auto legal = (masks.col(j).array() > Scalar{0}).count();
    if (legal > 0) sum += std::log(static_cast<Scalar>(legal));
  }
  return sum / static_cast<Scalar>(masks.cols());
}

#define DBR_INSTANTIATE(Scalar)                                                                         \
  template void ExpectedTargetValue<Scalar>(const Categorical<Scalar>&, const ConstMatrixRef<Scalar>&,  \
                                            const ConstMatrixRef<Scalar>&, Scalar, VectorX<Scalar>*);   \
  template void GreedyValue<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&,       \
                                    const ConstMatrixRef<Scalar>&, VectorX<Scalar>*);                   \
  template void ComputeAdvantages<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&, \
                                          const ConstMatrixRef<Scalar>&, const VectorX<Scalar>&,        \
                                          std::vector<float>*);                                         \
  template SoftPolicyLoss<Scalar> DiscreteSoftPolicyLoss<Scalar>(                                       \
      const Categorical<Scalar>&, const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&, Scalar, \
      VectorX<Scalar>*, MatrixX<Scalar>*);                                                              \
  template Scalar MeanGreatestEntropy<Scalar>(const ConstMatrixRef<Scalar>&);                           \
  template Scalar CriticLoss<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&,      \
                                     const VectorX<Scalar>&, MatrixX<Scalar>*);                         \
  template void Divergence<Scalar>(DbrConfig::Divergence, Scalar, const Categorical<Scalar>&,           \
                                   const Categorical<Scalar>&, VectorX<Scalar>*, MatrixX<Scalar>*);     \
  template ConstrainedLoss<Scalar> ConstrainedPolicyLoss<Scalar>(                                       \
      const PolicyLossOptions&, const ValuedPolicy<Scalar>&, const BehaviorConstraint<Scalar>&,         \
      PolicyLossWorkspace<Scalar>*, MatrixX<Scalar>*);                                                  \
  template PolicyLoss<Scalar> DualBehaviorPolicyLoss<Scalar>(                                           \
      const PolicyLossOptions&, const Categorical<Scalar>&, const ConstMatrixRef<Scalar>&,              \
      const ConstMatrixRef<Scalar>&, const Categorical<Scalar>&, const Categorical<Scalar>&, Scalar,    \
      PolicyLossWorkspace<Scalar>*, MatrixX<Scalar>*);

DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
