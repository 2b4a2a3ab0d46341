// Tests the divergences against reference values from PyTorch in double and against central differences.
#include "nn/divergence.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "nn/tanh_gaussian.h"
#include "tests/nn/gaussian_cases.h"

namespace dbr {
namespace {

using Json = nlohmann::json;
using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

double SampledMmdSum(const Matrix& x, const Matrix& y, Eigen::Index n, const Kernel& kernel,
                     Matrix* d_x = nullptr) {
  Vector mmd;
  SampledMmd<double>({x, y, n}, kernel, &mmd, d_x);
  return mmd.sum();
}

double ExactMmdSum(const Gaussian& p, const Gaussian& q, double sigma,
                   GaussianGradient<double>* d_p = nullptr) {
  Vector mmd;
  ExactMmd<double>(p.view(), q.view(), sigma, &mmd, d_p);
  return mmd.sum();
}

double KlSum(const Gaussian& p, const Gaussian& q, GaussianGradient<double>* d_p = nullptr,
             GaussianGradient<double>* d_q = nullptr) {
  Vector kl;
  GaussianKl<double>(p.view(), q.view(), &kl, d_p, d_q);
  return kl.sum();
}

TEST(SampledMmdTest, MatchesReferenceValuesAndGradients) {
  ForEachCase("mmd", [](const Json& c) {
    const Kernel kernel{c["kernel"] == "gaussian" ? KernelKind::kGaussian : KernelKind::kLaplacian,
                        c["sigma"].get<double>()};
    const Matrix x = ToMatrix(c["x"]), y = ToMatrix(c["y"]);
    Vector mmd;
    Matrix d_x;
    SampledMmd<double>({x, y, static_cast<Eigen::Index>(c["x"].size())}, kernel, &mmd, &d_x);
    ExpectNear(mmd, ToVector(c["value"]));
    ExpectNear(d_x, ToMatrix(c["grad_x_of_sum"]), 1e-9);
  });
}

TEST(SampledMmdTest, GradientMatchesCentralDifferences) {
  Rng rng(1);
  for (const KernelKind kind : {KernelKind::kGaussian, KernelKind::kLaplacian}) {
    const Matrix x = Normals(3, 4 * 5, rng), y = Normals(3, 4 * 2, rng);
    Matrix d_x;
    SampledMmdSum(x, y, 4, {kind, 0.7}, &d_x);
    ExpectIsGradient(
        d_x,
        [&](const Matrix& at) {
          return SampledMmdSum(at, y, 4, {kind, 0.7});
        },
        x);
  }
}

TEST(SampledMmdTest, EqualSetsAreAtTheFloorWithAFiniteGradient) {
  Rng rng(2);
  const MatrixX<float> x = Normals(2, 12, rng).cast<float>();
  VectorX<float> mmd;
  MatrixX<float> d_x;
  SampledMmd<float>({x, x, 3}, {KernelKind::kGaussian, 1.0}, &mmd, &d_x);
  EXPECT_NEAR(mmd.maxCoeff(), 1e-3, 1e-4);
  EXPECT_TRUE(d_x.allFinite());
}

TEST(SampledMmdTest, ApproachesTheExactValueWithManySamples) {
  Rng rng(3);
  constexpr Eigen::Index kSamples = 3000;
  const Gaussian p = RandomGaussian(2, 1, rng), q = RandomGaussian(2, 1, rng);
  const auto draw = [&](const Gaussian& g) -> Matrix {
    const Matrix spread = Normals(2, kSamples, rng).array().colwise() * g.log_std.col(0).array().exp();
    return spread.colwise() + g.mean.col(0);
  };
  EXPECT_NEAR(SampledMmdSum(draw(p), draw(q), 1, {KernelKind::kGaussian, 1.0}), ExactMmdSum(p, q, 1.0), 0.03);
}

TEST(ExactMmdTest, GradientMatchesCentralDifferences) {
  Rng rng(4);
  for (const double sigma : {0.3, 1.0, 20.0}) {
    const Gaussian p = RandomGaussian(4, 3, rng), q = RandomGaussian(4, 3, rng);
    GaussianGradient<double> d_p;
    ExactMmdSum(p, q, sigma, &d_p);
    ExpectIsGradient(
        d_p.mean,
        [&](const Matrix& at) {
          return ExactMmdSum({at, p.log_std}, q, sigma);
        },
        p.mean);
    ExpectIsGradient(
        d_p.log_std,
        [&](const Matrix& at) {
          return ExactMmdSum({p.mean, at}, q, sigma);
        },
        p.log_std);
  }
}

TEST(ExactMmdTest, IsTheFloorBetweenEqualsAndSymmetric) {
  Rng rng(5);
  const Gaussian p = RandomGaussian(3, 4, rng), q = RandomGaussian(3, 4, rng);
  EXPECT_NEAR(ExactMmdSum(p, p, 1.0), 4 * std::sqrt(kMmdFloor), 1e-9);
  EXPECT_NEAR(ExactMmdSum(p, q, 1.0), ExactMmdSum(q, p, 1.0), 1e-12);
}

TEST(ExactMmdTest, PointMassesFollowTheKernelItself) {
  const Gaussian p{Matrix::Zero(1, 1), Matrix::Constant(1, 1, -20)};
  const Gaussian q{Matrix::Constant(1, 1, 2.0), Matrix::Constant(1, 1, -20)};
  EXPECT_NEAR(ExactMmdSum(p, q, 3.0), std::sqrt(2 - 2 * std::exp(-4 / 6.0) + kMmdFloor), 1e-9);
}

double SquaredMmdSum(const Gaussian& p, const Gaussian& q, double sigma,
                     GaussianGradient<double>* d_p = nullptr) {
  Vector squared;
  SquaredMmd<double>(p.view(), q.view(), sigma, &squared, d_p);
  return squared.sum();
}

TEST(SquaredMmdTest, IsTheSquareOfTheMmdWithoutItsFloor) {
  Rng rng(9);
  const Gaussian p = RandomGaussian(3, 4, rng), q = RandomGaussian(3, 4, rng);
  Vector squared, mmd;
  SquaredMmd<double>(p.view(), q.view(), 0.7, &squared, nullptr);
  ExactMmd<double>(p.view(), q.view(), 0.7, &mmd, nullptr);
  ExpectNear(squared, (mmd.array().square() - kMmdFloor).matrix(), 1e-12);
  EXPECT_GT(squared.minCoeff(), 1e-3);
  EXPECT_EQ(SquaredMmdSum(p, p, 0.7), 0) << "rounding leads to nothing below 0";
}

TEST(SquaredMmdTest, GradientMatchesCentralDifferences) {
  Rng rng(10);
  for (const double sigma : {0.3, 1.0, 20.0}) {
    const Gaussian p = RandomGaussian(4, 3, rng), q = RandomGaussian(4, 3, rng);
    GaussianGradient<double> d_p;
    SquaredMmdSum(p, q, sigma, &d_p);
    ExpectIsGradient(
        d_p.mean,
        [&](const Matrix& at) {
          return SquaredMmdSum({at, p.log_std}, q, sigma);
        },
        p.mean);
    ExpectIsGradient(
        d_p.log_std,
        [&](const Matrix& at) {
          return SquaredMmdSum({p.mean, at}, q, sigma);
        },
        p.log_std);
  }
}

// Ten times nearer means a tenth of the gradient. That of the root keeps its length outside the floor.
TEST(SquaredMmdTest, TheGradientGoesTo0WithTheDistanceWhereThatOfTheRootDoesNot) {
  Rng rng(11);
  const Gaussian q = RandomGaussian(3, 1, rng);
  const Matrix direction = Normals(3, 1, rng);
  const auto length = [&](auto* sum, double distance) {
    GaussianGradient<double> d_p;
    sum({q.mean + distance * direction, q.log_std}, q, 1, &d_p);
    return d_p.mean.norm();
  };
  EXPECT_NEAR(length(SquaredMmdSum, 1e-4) / length(SquaredMmdSum, 1e-3), 0.1, 1e-3);
  EXPECT_EQ(length(SquaredMmdSum, 0), 0);
  EXPECT_NEAR(length(ExactMmdSum, 0.05) / length(ExactMmdSum, 0.1), 1, 0.05);
}

Matrix RandomProbabilities(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  const Matrix weights = Normals(rows, cols, rng).array().exp();
  return weights.array().rowwise() / weights.colwise().sum().array();
}

double CategoricalMmdSum(const Matrix& p, const Matrix& q, double sigma, Matrix* d_p = nullptr) {
  Vector mmd;
  CategoricalMmd<double>(p, q, sigma, &mmd, d_p);
  return mmd.sum();
}

TEST(CategoricalMmdTest, IsTheExpectationOfTheKernelOnOneHotChoices) {
  Rng rng(6);
  const Matrix p = RandomProbabilities(5, 1, rng), q = RandomProbabilities(5, 1, rng);
  const double sigma = 0.8;
  double squared = 0;
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 5; ++b) {
      const double kernel = std::exp(-(a == b ? 0.0 : 2.0) / (2 * sigma));
      squared += kernel * (p(a, 0) * p(b, 0) + q(a, 0) * q(b, 0) - 2 * p(a, 0) * q(b, 0));
    }
  }
  EXPECT_NEAR(CategoricalMmdSum(p, q, sigma), std::sqrt(squared + kMmdFloor), 1e-12);
}

TEST(CategoricalMmdTest, GradientsMatchCentralDifferences) {
  Rng rng(7);
  const Matrix p = RandomProbabilities(7, 4, rng), q = RandomProbabilities(7, 4, rng);
  Matrix d_p;
  CategoricalMmdSum(p, q, 1.5, &d_p);
  ExpectIsGradient(
      d_p, [&](const Matrix& at) { return CategoricalMmdSum(at, q, 1.5); }, p);
  ExpectIsGradient(
      -d_p, [&](const Matrix& at) { return CategoricalMmdSum(p, at, 1.5); }, q);
}

double SquaredCategoricalMmdSum(const Matrix& p, const Matrix& q, double sigma, Matrix* d_p = nullptr) {
  Vector squared;
  SquaredCategoricalMmd<double>(p, q, sigma, &squared, d_p);
  return squared.sum();
}

TEST(SquaredCategoricalMmdTest, IsTheSquareOfTheMmdWithoutItsFloor) {
  Rng rng(12);
  const Matrix p = RandomProbabilities(5, 4, rng), q = RandomProbabilities(5, 4, rng);
  Vector squared, mmd;
  SquaredCategoricalMmd<double>(p, q, 0.8, &squared, nullptr);
  CategoricalMmd<double>(p, q, 0.8, &mmd, nullptr);
  ExpectNear(squared, (mmd.array().square() - kMmdFloor).matrix(), 1e-12);
  EXPECT_GT(squared.minCoeff(), 1e-3);
}

TEST(SquaredCategoricalMmdTest, GradientMatchesCentralDifferencesAndGoesTo0BetweenEquals) {
  Rng rng(13);
  const Matrix p = RandomProbabilities(7, 4, rng), q = RandomProbabilities(7, 4, rng);
  Matrix d_p, near;
  SquaredCategoricalMmdSum(p, q, 1.5, &d_p);
  ExpectIsGradient(
      d_p, [&](const Matrix& at) { return SquaredCategoricalMmdSum(at, q, 1.5); }, p);
  SquaredCategoricalMmdSum(q + 0.01 * (p - q), q, 1.5, &near);
  ExpectNear(near, 0.01 * d_p, 1e-12);
  SquaredCategoricalMmdSum(q, q, 1.5, &near);
  EXPECT_TRUE(near.isZero(0));
}

TEST(GaussianKlTest, MatchesReferenceValuesAndGradients) {
  ForEachCase("gaussian_kl", [](const Json& c) {
    const Gaussian p{ToMatrix(c["p_mean"]), ToMatrix(c["p_log_std"])};
    const Gaussian q{ToMatrix(c["q_mean"]), ToMatrix(c["q_log_std"])};
    Vector kl;
    GaussianGradient<double> d_p;
    GaussianKl<double>(p.view(), q.view(), &kl, &d_p, nullptr);
    ExpectNear(kl, ToVector(c["kl"]));
    ExpectNear(d_p.mean, ToMatrix(c["grad_p_mean_of_sum"]));
    ExpectNear(d_p.log_std, ToMatrix(c["grad_p_log_std_of_sum"]));
  });
}

TEST(GaussianKlTest, GradientsOfBothSidesMatchCentralDifferences) {
  Rng rng(8);
  const Gaussian p = RandomGaussian(4, 3, rng), q = RandomGaussian(4, 3, rng);
  GaussianGradient<double> d_p, d_q;
  KlSum(p, q, &d_p, &d_q);
  ExpectIsGradient(
      d_p.mean,
      [&](const Matrix& at) {
        return KlSum({at, p.log_std}, q);
      },
      p.mean);
  ExpectIsGradient(
      d_p.log_std,
      [&](const Matrix& at) {
        return KlSum({p.mean, at}, q);
      },
      p.log_std);
  ExpectIsGradient(
      d_q.mean,
      [&](const Matrix& at) {
        return KlSum(p, {at, q.log_std});
      },
      q.mean);
  ExpectIsGradient(
      d_q.log_std,
      [&](const Matrix& at) {
        return KlSum(p, {q.mean, at});
      },
      q.log_std);
}

TEST(SampledKlTest, GradientMatchesCentralDifferences) {
  Rng rng(21);
  constexpr int kDraws = 4;
  const Gaussian p = RandomGaussian(3, 5, rng), q = RandomGaussian(3, 5, rng);
  const Matrix noise = Normals(3, kDraws * 5, rng);
  const Vector weights = Normals(5, 1, rng);
  const auto weighted = [&](const Gaussian& at, GaussianGradient<double>* gradient) {
    Vector kl;
    SampledKl<double>(at.view(), q.view(), noise, &kl, gradient);
    return kl.dot(weights);
  };
  GaussianGradient<double> gradient;
  weighted(p, &gradient);
  gradient.mean.array().rowwise() *= weights.transpose().array();
  gradient.log_std.array().rowwise() *= weights.transpose().array();
  ExpectIsGradient(
      gradient.mean,
      [&](const Matrix& at) {
        return weighted({at, p.log_std}, nullptr);
      },
      p.mean);
  ExpectIsGradient(
      gradient.log_std,
      [&](const Matrix& at) {
        return weighted({p.mean, at}, nullptr);
      },
      p.log_std);
}

TEST(SampledKlTest, IsTheDifferenceOfTheLogProbabilitiesOfTheDraws) {
  Rng rng(22);
  const Gaussian p = RandomGaussian(2, 3, rng), q = RandomGaussian(2, 3, rng);
  const Matrix noise = 0.5 * Normals(2, 3, rng);
  TanhSample<double> sample;
  SampleTanhGaussian<double>(p.view(), noise, &sample);
  Vector kl, under_q;
  GaussianGradient<double> unused;
  TanhLogProb<double>(q.view(), sample.action, &under_q, &unused);
  SampledKl<double>(p.view(), q.view(), noise, &kl, nullptr);
  ExpectNear(kl, sample.log_prob - under_q, 1e-8);
}

TEST(SampledKlTest, TheMeanOfManyDrawsIsTheExactKl) {
  Rng rng(23);
  constexpr int kDraws = 40000;
  const Gaussian p = RandomGaussian(2, 1, rng), q = RandomGaussian(2, 1, rng);
  Vector kl;
  SampledKl<double>(p.view(), q.view(), Normals(2, kDraws, rng), &kl, nullptr);
  const double exact = KlSum(p, q);
  EXPECT_NEAR(kl[0], exact, 0.03 * (1 + exact));
}

}  // namespace
}  // namespace dbr
