#include "learner/objectives/continuous_losses.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "nn/keep_nan.h"

namespace dbr {

template <class Scalar>
Scalar SquaredError(const ConstMatrixRef<Scalar>& q, const VectorX<Scalar>& y, MatrixX<Scalar>* d_q) {
  const auto n = static_cast<Scalar>(q.cols());
  *d_q = q - y.transpose();
  const Scalar loss = d_q->squaredNorm() / n;
  *d_q *= 2 / n;
  return loss;
}

template <class Scalar>
void GreatestTargetValue(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                         Scalar min_weight, VectorX<Scalar>* value, const SoftValue<Scalar>* soft) {
  const Eigen::Index n = value->size();
  DBR_CHECK(n > 0 && q1.cols() % n == 0 && q2.cols() == q1.cols());
  for (Eigen::Index j = 0; j < q1.cols(); ++j) {
    const Scalar low = SmallerOrNan(q1(0, j), q2(0, j)), high = GreaterOrNan(q1(0, j), q2(0, j));
    Scalar each = min_weight * low + (1 - min_weight) * high;
    if (soft != nullptr) each -= soft->temperature * soft->log_prob[j];
    Scalar& greatest = (*value)[j % n];
    greatest = j < n ? each : GreaterOrNan(greatest, each);
  }
}

template <class Scalar>
void MeanOfSmaller(const ConstMatrixRef<Scalar>& q1, const ConstMatrixRef<Scalar>& q2,
                   VectorX<Scalar>* value) {
  const Eigen::Index n = value->size();
  DBR_CHECK(n > 0 && q1.cols() % n == 0 && q2.cols() == q1.cols());
  const Eigen::Index draws = q1.cols() / n;
  value->setZero();
  for (Eigen::Index j = 0; j < q1.cols(); ++j) (*value)[j % n] += SmallerOrNan(q1(0, j), q2(0, j));
  *value /= static_cast<Scalar>(draws);
}

template <class Scalar>
void SmallerMeanQTerm(const QTermOptions& options, const ConstMatrixRef<Scalar>& q1,
                      const ConstMatrixRef<Scalar>& q2, Eigen::Index n, QTerm<Scalar>* term) {
  DBR_CHECK(n > 0 && q1.cols() % n == 0 && q2.cols() == q1.cols());
  const Eigen::Index count = q1.cols() / n;
  term->d_q1.setZero(1, q1.cols());
  term->d_q2.setZero(1, q2.cols());
  Scalar sum = 0, size = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    Scalar mean1 = 0, mean2 = 0;
    for (Eigen::Index k = j; k < q1.cols(); k += n) {
      mean1 += q1(0, k);
      mean2 += q2(0, k);
    }
    const Scalar smaller = SmallerOrNan(mean1, mean2) / static_cast<Scalar>(count);
    sum += smaller;
    size += std::abs(smaller);
    MatrixX<Scalar>& d_q = mean1 <= mean2 ? term->d_q1 : term->d_q2;
    for (Eigen::Index k = j; k < q1.cols(); k += n) d_q(0, k) = -1;
  }
  const auto states = static_cast<Scalar>(n);
  term->value = sum / states;
  term->scale = options.normalize ? std::max(size / states, Scalar{1e-6}) : Scalar{1};
  const Scalar each = options.use_q ? 1 / (term->scale * states * static_cast<Scalar>(count)) : Scalar{0};
  term->loss = options.use_q ? -term->value / term->scale : Scalar{0};
  term->d_q1 *= each;
  term->d_q2 *= each;
}

#define DBR_INSTANTIATE(Scalar)                                                                           \
  template Scalar SquaredError<Scalar>(const ConstMatrixRef<Scalar>&, const VectorX<Scalar>&,             \
                                       MatrixX<Scalar>*);                                                 \
  template void GreatestTargetValue<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&, \
                                            Scalar, VectorX<Scalar>*, const SoftValue<Scalar>*);          \
  template void MeanOfSmaller<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&,       \
                                      VectorX<Scalar>*);                                                  \
  template void SmallerMeanQTerm<Scalar>(const QTermOptions&, const ConstMatrixRef<Scalar>&,              \
                                         const ConstMatrixRef<Scalar>&, Eigen::Index, QTerm<Scalar>*);

DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
