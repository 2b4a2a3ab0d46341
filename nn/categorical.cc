#include "nn/categorical.h"

#include <cmath>
#include <limits>

#include "core/check.h"

namespace dbr {

template <class Scalar>
void MaskedSoftmax(const ConstMatrixRef<Scalar>& logits, const ConstMatrixRef<Scalar>& masks,
                   Categorical<Scalar>* distribution) {
  DBR_CHECK(logits.rows() == masks.rows() && logits.cols() == masks.cols());
  MatrixX<Scalar>& log_p = distribution->log_probabilities;
  MatrixX<Scalar>& p = distribution->probabilities;
  log_p.resize(logits.rows(), logits.cols());
  p.resize(logits.rows(), logits.cols());
  const Eigen::Index actions = logits.rows();
  for (Eigen::Index j = 0; j < logits.cols(); ++j) {
    const Scalar* z = logits.col(j).data();
    const Scalar* mask = masks.col(j).data();
    Scalar largest = -std::numeric_limits<Scalar>::infinity();
    for (Eigen::Index k = 0; k < actions; ++k) {
      if (mask[k] > 0 && z[k] > largest) largest = z[k];
    }
    Scalar sum = 0;
    for (Eigen::Index k = 0; k < actions; ++k) {
      p(k, j) = mask[k] > 0 ? std::exp(z[k] - largest) : Scalar{0};
      sum += p(k, j);
    }
    // The sum is 0 without a legal action alone; it is a NaN where a legal logit is one.
    const Scalar log_sum = sum != 0 ? largest + std::log(sum) : Scalar{0};
    const Scalar scale = sum != 0 ? 1 / sum : Scalar{0};
    for (Eigen::Index k = 0; k < actions; ++k) {
      p(k, j) *= scale;
      log_p(k, j) = mask[k] > 0 ? z[k] - log_sum : Scalar{0};
    }
  }
}

template <class Scalar>
Scalar NegativeLogLikelihood(const Categorical<Scalar>& distribution, const ConstMatrixRef<Scalar>& actions,
                             MatrixX<Scalar>* d_logits, const VectorX<Scalar>* weights) {
  const Eigen::Index n = distribution.probabilities.cols();
  DBR_CHECK(actions.rows() == 1 && actions.cols() == n && (weights == nullptr || weights->size() == n));
  const Scalar each = Scalar{1} / static_cast<Scalar>(n);
  if (d_logits != nullptr) d_logits->resize(distribution.probabilities.rows(), n);
  Scalar loss = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto a = static_cast<Eigen::Index>(actions(0, j));
    const Scalar weight = weights != nullptr ? each * (*weights)[j] : each;
    loss -= weight * distribution.log_probabilities(a, j);
    if (d_logits == nullptr) continue;
    d_logits->col(j) = weight * distribution.probabilities.col(j);
    (*d_logits)(a, j) -= weight;
  }
  return loss;
}

template <class Scalar>
void Entropy(const Categorical<Scalar>& p, VectorX<Scalar>* entropy) {
  *entropy = -p.probabilities.cwiseProduct(p.log_probabilities).colwise().sum().transpose();
}

template <class Scalar>
void KlDivergence(const Categorical<Scalar>& p, const Categorical<Scalar>& q, VectorX<Scalar>* kl) {
  *kl = p.probabilities.cwiseProduct(p.log_probabilities - q.log_probabilities).colwise().sum().transpose();
}

template <class Scalar>
void SoftmaxGradient(const Categorical<Scalar>& p, MatrixX<Scalar>* gradient) {
  for (Eigen::Index j = 0; j < gradient->cols(); ++j) {
    const Scalar mean = p.probabilities.col(j).dot(gradient->col(j));
    gradient->col(j) = p.probabilities.col(j).cwiseProduct((gradient->col(j).array() - mean).matrix());
  }
}

#define DBR_INSTANTIATE(Scalar)                                                                            \
  template void MaskedSoftmax<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&,        \
                                      Categorical<Scalar>*);                                               \
  template Scalar NegativeLogLikelihood<Scalar>(const Categorical<Scalar>&, const ConstMatrixRef<Scalar>&, \
                                                MatrixX<Scalar>*, const VectorX<Scalar>*);                 \
  template void Entropy<Scalar>(const Categorical<Scalar>&, VectorX<Scalar>*);                             \
  template void KlDivergence<Scalar>(const Categorical<Scalar>&, const Categorical<Scalar>&,               \
                                     VectorX<Scalar>*);                                                    \
  template void SoftmaxGradient<Scalar>(const Categorical<Scalar>&, MatrixX<Scalar>*);

DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
