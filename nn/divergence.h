// Divergences between policies, with hand-written gradients: maximum mean discrepancy (MMD; Gretton et al.
// 2012), from samples and exact, and KL of diagonal Gaussians.
#pragma once

#include "nn/gaussian.h"

namespace dbr {

// The functions here are pure, work column by column, and exist for float and double; outputs are resized,
// which allocates nothing where they have their size already. Every value is [n], one for each column
// (state); a gradient is that of the sum of the values, so that a caller weighs states by scaling its
// columns. Gradient outputs may be null.
//
// An MMD is sqrt(E k(x,x') + E k(y,y') - 2 E k(x,y) + kMmdFloor): the floor keeps its gradient finite at 0.
inline constexpr double kMmdFloor = 1e-6;

enum class KernelKind { kGaussian, kLaplacian };

// k(x, y) = exp(-d / (2 sigma)), d the squared Euclidean distance (Gaussian) or the sum of absolute
// differences (Laplacian).
struct Kernel {
  KernelKind kind = KernelKind::kGaussian;
  double sigma = 1;
};

// Samples of two distributions in each of n states: sample i of state s is column s * (cols() / n) + i.
template <class Scalar>
struct SampleSets {
  ConstMatrixRef<Scalar> x;  // [dimensions x n * samples of x]
  ConstMatrixRef<Scalar> y;  // [dimensions x n * samples of y]
  Eigen::Index n = 0;
};

// BEAR's estimate (Kumar et al. 2019), a sample's kernel with itself included, which lifts it above 0 between
// equal distributions. O(n dimensions samples^2). d_x is as x.
template <class Scalar>
void SampledMmd(const SampleSets<Scalar>& samples, const Kernel& kernel, VectorX<Scalar>* mmd,
                MatrixX<Scalar>* d_x);

// The exact MMD of diagonal Gaussians under the Gaussian kernel: the expectation of k is the product over
// dimensions of sqrt(sigma / t) exp(-(m_a - m_b)^2 / (2 t)), t = sigma + var_a + var_b.
template <class Scalar>
void ExactMmd(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q, double sigma,
              VectorX<Scalar>* mmd, GaussianGradient<Scalar>* d_p);

// The square of ExactMmd, without the floor. Its gradient goes to 0 where p becomes q; that of the root keeps
// its length there.
template <class Scalar>
void SquaredMmd(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q, double sigma,
                VectorX<Scalar>* squared, GaussianGradient<Scalar>* d_p);

// The exact MMD of categoricals [choices x n] under the Gaussian kernel on one-hot choices, which is 1
// between equal and kappa = exp(-1 / sigma) between different ones: its square is (1 - kappa) |p - q|^2. The
// gradient for q is -d_p.
template <class Scalar>
void CategoricalMmd(const ConstMatrixRef<Scalar>& p, const ConstMatrixRef<Scalar>& q, double sigma,
                    VectorX<Scalar>* mmd, MatrixX<Scalar>* d_p);

// The square of CategoricalMmd, without the floor.
template <class Scalar>
void SquaredCategoricalMmd(const ConstMatrixRef<Scalar>& p, const ConstMatrixRef<Scalar>& q, double sigma,
                           VectorX<Scalar>* squared, MatrixX<Scalar>* d_p);

// KL(p || q), in nats, summed over dimensions. The same before and after a tanh.
template <class Scalar>
void GaussianKl(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q, VectorX<Scalar>* kl,
                GaussianGradient<Scalar>* d_p, GaussianGradient<Scalar>* d_q);

// KL(p || q) estimated from draws of p: the mean over the draws u_k = p.mean + exp(p.log_std) * noise_k of
// log p(u_k) - log q(u_k), in nats. noise [dimensions x draws * n], draw k of state j in column k * n + j.
// The same for tanh(u_k): the tanh's change of variables stands in both densities. The gradient is pathwise,
// through the draws; q is a constant.
template <class Scalar>
void SampledKl(const GaussianView<Scalar>& p, const GaussianView<Scalar>& q,
               const ConstMatrixRef<Scalar>& noise, VectorX<Scalar>* kl, GaussianGradient<Scalar>* d_p);

}  // namespace dbr
