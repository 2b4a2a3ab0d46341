#include "learner/parts/discrete_losses.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "nn/divergence.h"

namespace dbr {
namespace {

// Adds -E[min_i sum_a pi Q_i] / scale to the loss and its gradient with respect to pi's probabilities to
// `gradient`.
template <class Scalar>
void AddQTerm(const PolicyLossOptions& options, const Categorical<Scalar>& policy,
              const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2, PolicyLoss<Scalar>* result,
              MatrixX<Scalar>* gradient) {
  const Eigen::Index n = q1.cols();
  Scalar sum = 0, size = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    const Scalar value1 = policy.probabilities.col(j).dot(q1.col(j));
    const Scalar value2 = policy.probabilities.col(j).dot(q2.col(j));
    const auto smaller = value1 <= value2 ? q1.col(j) : q2.col(j);
    sum += std::min(value1, value2);
    size += policy.probabilities.col(j).dot(smaller.cwiseAbs());
    gradient->col(j) -= smaller;
  }
  result->value = sum / static_cast<Scalar>(n);
  if (!options.use_q) {
    gradient->setZero();
    return;
  }
  const Scalar mean_size = size / static_cast<Scalar>(n);
  const Scalar scale = options.normalize_q ? std::max(mean_size, Scalar{1e-6}) : Scalar{1};
  *gradient /= scale * static_cast<Scalar>(n);
  result->loss -= result->value / scale;
}

}  // namespace

template <class Scalar>
void ExpectedTargetValue(const Categorical<Scalar>& policy, const ConstMatrixRef<Scalar>& q1,
                         const ConstMatrixRef<Scalar>& q2, Scalar min_weight, VectorX<Scalar>* value) {
  *value = (policy.probabilities.array() *
            (min_weight * q1.array().min(q2.array()) + (1 - min_weight) * q1.array().max(q2.array())))
               .colwise()
               .sum()
               .transpose();
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
  CategoricalMmd<Scalar>(p.probabilities, q.probabilities, mmd_sigma, divergence, d_probabilities);
}

template <class Scalar>
PolicyLoss<Scalar> DualBehaviorPolicyLoss(const PolicyLossOptions& options, const Categorical<Scalar>& policy,
                                          const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                                          const Categorical<Scalar>& beta_plus,
                                          const Categorical<Scalar>& beta_minus, Scalar alpha,
                                          PolicyLossWorkspace<Scalar>* workspace, MatrixX<Scalar>* d_logits) {
  PolicyLoss<Scalar> result;
  const auto n = static_cast<Scalar>(policy.probabilities.cols());
  d_logits->setZero(policy.probabilities.rows(), policy.probabilities.cols());
  AddQTerm(options, policy, q1, q2, &result, d_logits);

  const auto sigma = static_cast<Scalar>(options.mmd_sigma), epsilon = static_cast<Scalar>(options.epsilon);
  Divergence(options.divergence, sigma, policy, beta_plus, &workspace->plus, &workspace->d_plus);
  Divergence(options.divergence, sigma, policy, beta_minus, &workspace->minus, &workspace->d_minus);
  result.divergence_plus = workspace->plus.mean();
  result.divergence_minus = workspace->minus.mean();
  const Threshold<Scalar> threshold = ThresholdOf(options.constraint, epsilon, result.divergence_minus);
  result.threshold = threshold.value;
  result.loss += alpha * (result.divergence_plus - result.threshold);
  *d_logits += alpha / n * workspace->d_plus;
  if (options.repel_negative && threshold.moved_by_minus) *d_logits -= alpha / n * workspace->d_minus;

  Entropy(policy, &workspace->entropy);
  result.entropy = workspace->entropy.mean();
  const auto entropy_weight = static_cast<Scalar>(options.entropy_weight);
  result.loss -= entropy_weight * result.entropy;
  *d_logits += entropy_weight / n * policy.log_probabilities;
  SoftmaxGradient(policy, d_logits);
  return result;
}

#define DBR_INSTANTIATE(Scalar)                                                                        \
  template void ExpectedTargetValue<Scalar>(const Categorical<Scalar>&, const ConstMatrixRef<Scalar>&, \
                                            const ConstMatrixRef<Scalar>&, Scalar, VectorX<Scalar>*);  \
  template Scalar CriticLoss<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&,     \
                                     const VectorX<Scalar>&, MatrixX<Scalar>*);                        \
  template void Divergence<Scalar>(DbrConfig::Divergence, Scalar, const Categorical<Scalar>&,          \
                                   const Categorical<Scalar>&, VectorX<Scalar>*, MatrixX<Scalar>*);    \
  template PolicyLoss<Scalar> DualBehaviorPolicyLoss<Scalar>(                                          \
      const PolicyLossOptions&, const Categorical<Scalar>&, const ConstMatrixRef<Scalar>&,             \
      const ConstMatrixRef<Scalar>&, const Categorical<Scalar>&, const Categorical<Scalar>&, Scalar,   \
      PolicyLossWorkspace<Scalar>*, MatrixX<Scalar>*);

DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
