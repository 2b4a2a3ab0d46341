#include "nn/divergence.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace dbr {
namespace {

// A squared MMD: rounding may leave its sum of means below 0. A NaN stays one.
double KeepAbove0(double squared) {
  return std::max(squared, 0.0);
}

// The root of a squared MMD.
double MmdOf(double squared) {
  return std::sqrt(KeepAbove0(squared) + kMmdFloor);
}

// Turns squared MMDs [n] into MMDs.
template <class Scalar>
void TakeRoot(VectorX<Scalar>* values) {
  for (Scalar& value : *values) value = static_cast<Scalar>(MmdOf(value));
}

// Turns the gradient of squared MMDs [rows x n] into that of `mmd` [n], their roots.
template <class Scalar>
void ScaleByRoot(const VectorX<Scalar>& mmd, MatrixX<Scalar>* gradient) {
  for (Eigen::Index j = 0; j < mmd.size(); ++j) gradient->col(j) *= 1 / (2 * mmd[j]);
}

template <class Scalar>
struct KernelOf {
  KernelKind kind;
  Scalar sigma;

  // k(a, b) of two points of `size` entries.
  Scalar Value(const Scalar* a, const Scalar* b, Eigen::Index size) const {
    Scalar distance = 0;
    for (Eigen::Index d = 0; d < size; ++d) {
      const Scalar difference = a[d] - b[d];
      distance += kind == KernelKind::kGaussian ? difference * difference : std::abs(difference);
    }
    return std::exp(-distance / (2 * sigma));
  }
  // gradient += weight * dk/da, where `value` is k(a, b). The Laplacian's corner counts as flat.
  void AddGradient(const Scalar* a, const Scalar* b, Scalar value, Scalar weight, Eigen::Index size,
                   Scalar* gradient) const {
    const Scalar scale = -weight * value / sigma;
    for (Eigen::Index d = 0; d < size; ++d) {
      const Scalar difference = a[d] - b[d];
      if (kind == KernelKind::kGaussian) {
        gradient[d] += scale * difference;
      } else {
        gradient[d] += scale * static_cast<Scalar>((difference > 0) - (difference < 0)) / 2;
      }
    }
  }
};

// Columns of one state.
template <class Scalar>
struct Points {
  const Scalar* first;
  Eigen::Index count;
  Eigen::Index stride;
  Eigen::Index dimensions;

  const Scalar* operator[](Eigen::Index i) const { return first + i * stride; }
};

// The mean of k over all pairs; adds `weight` times its gradient with respect to a's points, pairs as (a_i,
// b_j), to d_a [dimensions x a.count] where that is not null. The sum is kept in double: differences of means
// are small.
template <class Scalar>
double MeanKernel(const KernelOf<Scalar>& kernel, const Points<Scalar>& a, const Points<Scalar>& b,
                  Scalar weight, Scalar* d_a) {
  const Scalar each = weight / static_cast<Scalar>(a.count * b.count);
  double sum = 0;
  for (Eigen::Index i = 0; i < a.count; ++i) {
    for (Eigen::Index j = 0; j < b.count; ++j) {
      const Scalar value = kernel.Value(a[i], b[j], a.dimensions);
      sum += value;
      if (d_a != nullptr) kernel.AddGradient(a[i], b[j], value, each, a.dimensions, d_a + i * a.dimensions);
    }
  }
  return sum / static_cast<double>(a.count * b.count);
}

template <class Scalar>
Points<Scalar> PointsOf(const ConstMatrixRef<Scalar>& columns, Eigen::Index state, Eigen::Index n) {
  const Eigen::Index count = columns.cols() / n;
  return {columns.data() + state * count * columns.outerStride(), count, columns.outerStride(),
          columns.rows()};
}

template <class Scalar>
void CheckSameShape(const ConstMatrixRef<Scalar>& a, const ConstMatrixRef<Scalar>& b) {
  DBR_CHECK(a.rows() == b.rows() && a.cols() == b.cols());
}

template <class Scalar>
void CheckSameShape(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q) {
  CheckSameShape<Scalar>(p.mean, p.log_std);
  CheckSameShape<Scalar>(p.mean, q.mean);
  CheckSameShape<Scalar>(q.mean, q.log_std);
}

// E k(a, b) of column j of two diagonal Gaussians.
template <class Scalar>
double ExpectedKernel(const GaussianView<Scalar>& a, const GaussianView<Scalar>& b, double sigma,
                      Eigen::Index j) {
  double product = 1, exponent = 0;
  for (Eigen::Index d = 0; d < a.mean.rows(); ++d) {
    const double difference = a.mean(d, j) - b.mean(d, j);
    const double t = sigma + std::exp(2.0 * a.log_std(d, j)) + std::exp(2.0 * b.log_std(d, j));
    product *= sigma / t;
    exponent -= difference * difference / (2 * t);
  }
  return std::sqrt(product) * std::exp(exponent);
}

}  // namespace

template <class Scalar>
void SampledMmd(const SampleSets<Scalar>& samples, const Kernel& kernel, VectorX<Scalar>* mmd,
                MatrixX<Scalar>* d_x) {
  const auto& [x, y, n] = samples;
  DBR_CHECK(n > 0 && x.rows() == y.rows() && x.cols() % n == 0 && y.cols() % n == 0 && x.cols() > 0 &&
            y.cols() > 0);
  const KernelOf<Scalar> k{kernel.kind, static_cast<Scalar>(kernel.sigma)};
  mmd->resize(n);
  if (d_x != nullptr) d_x->setZero(x.rows(), x.cols());
  for (Eigen::Index state = 0; state < n; ++state) {
    const Points<Scalar> xs = PointsOf<Scalar>(x, state, n), ys = PointsOf<Scalar>(y, state, n);
    Scalar* gradient = d_x != nullptr ? d_x->data() + state * xs.count * x.rows() : nullptr;
    // A point of x stands in both places of k(x, x'), which is symmetric: twice the gradient for the first
    // place.
    const double squared = MeanKernel<Scalar>(k, xs, xs, 2, gradient) +
                           MeanKernel<Scalar>(k, ys, ys, 0, nullptr) -
                           2 * MeanKernel<Scalar>(k, xs, ys, -2, gradient);
    const double value = MmdOf(squared);
    (*mmd)[state] = static_cast<Scalar>(value);
    if (d_x != nullptr) d_x->middleCols(state * xs.count, xs.count) *= static_cast<Scalar>(0.5 / value);
  }
}

template <class Scalar>
void SquaredMmd(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q, double sigma,
                VectorX<Scalar>* squared, GaussianGradient<Scalar>* d_p) {
  CheckSameShape(p, q);
  const Eigen::Index dimensions = p.mean.rows(), n = p.mean.cols();
  squared->resize(n);
  if (d_p != nullptr) d_p->Resize(dimensions, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double pp = ExpectedKernel(p, p, sigma, j), qq = ExpectedKernel(q, q, sigma, j);
    const double pq = ExpectedKernel(p, q, sigma, j);
    (*squared)[j] = static_cast<Scalar>(KeepAbove0(pp + qq - 2 * pq));
    for (Eigen::Index d = 0; d_p != nullptr && d < dimensions; ++d) {
      const double difference = p.mean(d, j) - q.mean(d, j);
      const double variance = std::exp(2.0 * p.log_std(d, j));
      const double t = sigma + variance + std::exp(2.0 * q.log_std(d, j));
      // Logarithmic derivatives of E k(p, q) for the mean, and of both expectations for the log-std.
      const double by_mean = -difference / t;
      const double by_log_std = variance * (difference * difference / t - 1) / t;
      const double own_by_log_std = -2 * variance / (sigma + 2 * variance);
      d_p->mean(d, j) = static_cast<Scalar>(-2 * pq * by_mean);
      d_p->log_std(d, j) = static_cast<Scalar>(pp * own_by_log_std - 2 * pq * by_log_std);
    }
  }
}

template <class Scalar>
void ExactMmd(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q, double sigma,
              VectorX<Scalar>* mmd, GaussianGradient<Scalar>* d_p) {
  SquaredMmd<Scalar>(p, q, sigma, mmd, d_p);
  TakeRoot(mmd);
  if (d_p == nullptr) return;
  ScaleByRoot(*mmd, &d_p->mean);
  ScaleByRoot(*mmd, &d_p->log_std);
}

template <class Scalar>
void SquaredCategoricalMmd(const ConstMatrixRef<Scalar>& p, const ConstMatrixRef<Scalar>& q, double sigma,
                           VectorX<Scalar>* squared, MatrixX<Scalar>* d_p) {
  CheckSameShape<Scalar>(p, q);
  const auto weight = static_cast<Scalar>(-std::expm1(-1 / sigma));  // 1 - kappa
  squared->resize(p.cols());
  for (Eigen::Index j = 0; j < p.cols(); ++j) (*squared)[j] = weight * (p.col(j) - q.col(j)).squaredNorm();
  if (d_p != nullptr) *d_p = 2 * weight * (p - q);
}

template <class Scalar>
void CategoricalMmd(const ConstMatrixRef<Scalar>& p, const ConstMatrixRef<Scalar>& q, double sigma,
                    VectorX<Scalar>* mmd, MatrixX<Scalar>* d_p) {
  SquaredCategoricalMmd<Scalar>(p, q, sigma, mmd, d_p);
  TakeRoot(mmd);
  if (d_p != nullptr) ScaleByRoot(*mmd, d_p);
}

template <class Scalar>
void GaussianKl(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q, VectorX<Scalar>* kl,
                GaussianGradient<Scalar>* d_p, GaussianGradient<Scalar>* d_q) {
  CheckSameShape(p, q);
  const Eigen::Index dimensions = p.mean.rows(), n = p.mean.cols();
  kl->resize(n);
  if (d_p != nullptr) d_p->Resize(dimensions, n);
  if (d_q != nullptr) d_q->Resize(dimensions, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    Scalar sum = 0;
    for (Eigen::Index d = 0; d < dimensions; ++d) {
      const Scalar difference = p.mean(d, j) - q.mean(d, j);
      const Scalar log_ratio = p.log_std(d, j) - q.log_std(d, j);
      const Scalar ratio = std::exp(2 * log_ratio);  // of the variances
      const Scalar precision = std::exp(-2 * q.log_std(d, j));
      const Scalar distance = difference * difference * precision;
      sum += (ratio + distance - 1) / 2 - log_ratio;
      if (d_p != nullptr) {
        d_p->mean(d, j) = difference * precision;
        d_p->log_std(d, j) = ratio - 1;
      }
      if (d_q != nullptr) {
        d_q->mean(d, j) = -difference * precision;
        d_q->log_std(d, j) = 1 - ratio - distance;
      }
    }
    (*kl)[j] = sum;
  }
}

template <class Scalar>
void SampledKl(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q,
               const ConstMatrixRef<Scalar>& noise, VectorX<Scalar>* kl, GaussianGradient<Scalar>* d_p) {
  CheckSameShape(p, q);
  const Eigen::Index dimensions = p.mean.rows(), n = p.mean.cols();
  DBR_CHECK(noise.rows() == dimensions && noise.cols() > 0 && noise.cols() % n == 0);
  const Eigen::Index samples = noise.cols() / n;
  const auto draws = static_cast<Scalar>(samples);
  kl->setZero(n);
  if (d_p != nullptr) d_p->Resize(dimensions, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index d = 0; d < dimensions; ++d) {
      const Scalar deviation = std::exp(p.log_std(d, j)), precision = std::exp(-q.log_std(d, j));
      Scalar sum = 0, d_mean = 0, d_deviation = 0;
      for (Eigen::Index k = j; k < noise.cols(); k += n) {
        const Scalar e = noise(d, k);
        const Scalar z = (p.mean(d, j) + deviation * e - q.mean(d, j)) * precision;  // deviations of q
        sum += (z * z - e * e) / 2;
        d_mean += z * precision;
        d_deviation += z * precision * e;
      }
      (*kl)[j] += sum / draws + q.log_std(d, j) - p.log_std(d, j);
      if (d_p == nullptr) continue;
      d_p->mean(d, j) = d_mean / draws;
      d_p->log_std(d, j) = d_deviation * deviation / draws - 1;
    }
  }
}

#define DBR_INSTANTIATE(Scalar)                                                                              \
  template void SampledMmd<Scalar>(const SampleSets<Scalar>&, const Kernel&, VectorX<Scalar>*,               \
                                   MatrixX<Scalar>*);                                                        \
  template void ExactMmd<Scalar>(const GaussianView<Scalar>&, const GaussianView<Scalar>&, double,           \
                                 VectorX<Scalar>*, GaussianGradient<Scalar>*);                               \
  template void SquaredMmd<Scalar>(const GaussianView<Scalar>&, const GaussianView<Scalar>&, double,         \
                                   VectorX<Scalar>*, GaussianGradient<Scalar>*);                             \
  template void SquaredCategoricalMmd<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&,  \
                                              double, VectorX<Scalar>*, MatrixX<Scalar>*);                   \
  template void CategoricalMmd<Scalar>(const ConstMatrixRef<Scalar>&, const ConstMatrixRef<Scalar>&, double, \
                                       VectorX<Scalar>*, MatrixX<Scalar>*);                                  \
  template void GaussianKl<Scalar>(const GaussianView<Scalar>&, const GaussianView<Scalar>&,                 \
                                   VectorX<Scalar>*, GaussianGradient<Scalar>*, GaussianGradient<Scalar>*);  \
  template void SampledKl<Scalar>(const GaussianView<Scalar>&, const GaussianView<Scalar>&,                  \
                                  const ConstMatrixRef<Scalar>&, VectorX<Scalar>*,                           \
                                  GaussianGradient<Scalar>*);
DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
