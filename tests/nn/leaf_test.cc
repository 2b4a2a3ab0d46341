// Tests the basic functions of the continuous losses against reference values from PyTorch in double and
// against central differences.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/divergence.h"
#include "nn/tanh_gaussian.h"
#include "tests/support/numeric.h"
#include "tests/support/reference_json.h"

namespace dbr {
namespace {

using Json = nlohmann::json;
using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

Matrix Normals(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

struct Gaussian {
  Matrix mean, log_std;

  GaussianView<double> view() const { return {mean, log_std}; }
};

Gaussian RandomGaussian(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return {Normals(rows, cols, rng), 0.5 * Normals(rows, cols, rng)};
}

// Runs `check` on every case of `key` in every losses*.json that has some.
void ForEachCase(const std::string& key, const std::function<void(const Json&)>& check) {
  std::size_t cases = 0;
  for (const ReferenceFile& file : ReferenceFiles("losses", "losses")) {
    ASSERT_TRUE(file.json.is_object()) << file.name << " is not a JSON object";
    if (!file.json.contains(key)) continue;
    for (const Json& c : file.json[key]["cases"]) {
      SCOPED_TRACE(file.name + ": " + key + " " + std::to_string(cases++));
      check(c);
    }
  }
  EXPECT_GT(cases, 0u) << "no " << key << " in " << ReferenceDir() / "losses" / "losses*.json";
}

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

TEST(TanhGaussianTest, SamplesMatchReferenceValuesAndGradients) {
  ForEachCase("tanh_gaussian", [](const Json& c) {
    const Gaussian g{ToMatrix(c["mean"]), ToMatrix(c["log_std"])};
    const Matrix noise = ToMatrix(c["noise"]);
    TanhSample<double> sample;
    SampleTanhGaussian<double>(g.view(), noise, &sample);
    ExpectNear(sample.action, ToMatrix(c["action"]));
    ExpectNear(sample.log_prob, ToVector(c["log_prob_of_sample"]));
    const Matrix no_action = Matrix::Zero(noise.rows(), noise.cols());
    const Vector ones = Vector::Ones(noise.cols());
    GaussianGradient<double> gradient;
    BackpropTanhSample<double>(g.view(), noise, sample, {no_action, ones}, &gradient);
    ExpectNear(gradient.mean, ToMatrix(c["grad_mean_of_sum_pathwise"]));
    ExpectNear(gradient.log_std, ToMatrix(c["grad_log_std_of_sum_pathwise"]));
  });
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

TEST(TanhGaussianTest, LogProbOfDataMatchesReferenceValuesAndGradients) {
  ForEachCase("tanh_gaussian", [](const Json& c) {
    const Gaussian g{ToMatrix(c["mean"]), ToMatrix(c["log_std"])};
    Vector log_prob;
    GaussianGradient<double> gradient;
    TanhLogProb<double>(g.view(), ToMatrix(c["data_action"]), &log_prob, &gradient);
    ExpectNear(log_prob, ToVector(c["log_prob_of_data"]));
    ExpectNear(gradient.mean, ToMatrix(c["grad_mean_of_sum_data"]));
    ExpectNear(gradient.log_std, ToMatrix(c["grad_log_std_of_sum_data"]));
  });
}

TEST(TanhGaussianTest, PathwiseGradientMatchesCentralDifferences) {
  Rng rng(9);
  const Gaussian g = RandomGaussian(3, 4, rng);
  const Matrix noise = Normals(3, 4, rng), d_action = Normals(3, 4, rng);
  const Vector d_log_prob = Normals(4, 1, rng);
  // The loss is linear in actions and log-probabilities. To first order, every loss is.
  const auto loss = [&](const Gaussian& at) {
    TanhSample<double> sample;
    SampleTanhGaussian<double>(at.view(), noise, &sample);
    return sample.action.cwiseProduct(d_action).sum() + sample.log_prob.dot(d_log_prob);
  };
  TanhSample<double> sample;
  SampleTanhGaussian<double>(g.view(), noise, &sample);
  GaussianGradient<double> gradient;
  BackpropTanhSample<double>(g.view(), noise, sample, {d_action, d_log_prob}, &gradient);
  ExpectIsGradient(
      gradient.mean,
      [&](const Matrix& at) {
        return loss({at, g.log_std});
      },
      g.mean);
  ExpectIsGradient(
      gradient.log_std,
      [&](const Matrix& at) {
        return loss({g.mean, at});
      },
      g.log_std);
}

TEST(TanhGaussianTest, LogProbGradientMatchesCentralDifferences) {
  Rng rng(10);
  const Gaussian g = RandomGaussian(3, 4, rng);
  const Matrix actions = Normals(3, 4, rng).array().tanh();
  const auto sum = [&](const Gaussian& at) {
    Vector log_prob;
    GaussianGradient<double> unused;
    TanhLogProb<double>(at.view(), actions, &log_prob, &unused);
    return log_prob.sum();
  };
  Vector log_prob;
  GaussianGradient<double> gradient;
  TanhLogProb<double>(g.view(), actions, &log_prob, &gradient);
  ExpectIsGradient(
      gradient.mean,
      [&](const Matrix& at) {
        return sum({at, g.log_std});
      },
      g.mean);
  ExpectIsGradient(
      gradient.log_std,
      [&](const Matrix& at) {
        return sum({g.mean, at});
      },
      g.log_std);
}

TEST(TanhGaussianTest, StaysFiniteInFloatAtTheEndsOfTheRange) {
  MatrixX<float> mean(1, 4), log_std(1, 4), noise(1, 4);
  mean << 30, -30, 0, 0;
  log_std << 2, 2, -20, 2;
  noise << 4, -4, 4, -4;
  TanhSample<float> sample;
  SampleTanhGaussian<float>({mean, log_std}, noise, &sample);
  EXPECT_TRUE(sample.log_prob.allFinite()) << sample.log_prob.transpose();
  const VectorX<float> ones = VectorX<float>::Ones(4);
  GaussianGradient<float> gradient;
  BackpropTanhSample<float>({mean, log_std}, noise, sample, {noise, ones}, &gradient);
  EXPECT_TRUE(gradient.mean.allFinite() && gradient.log_std.allFinite());
  MatrixX<float> ends(1, 4);
  ends << 1, -1, 1, -1;
  VectorX<float> log_prob;
  TanhLogProb<float>({mean, MatrixX<float>::Constant(1, 4, -5)}, ends, &log_prob, &gradient);
  EXPECT_TRUE(log_prob.allFinite() && gradient.mean.allFinite() && gradient.log_std.allFinite());
}

TEST(TanhGaussianTest, DensityIntegratesToOne) {
  constexpr int kPoints = 20000;
  const Matrix mean = Matrix::Constant(1, kPoints, 0.4), log_std = Matrix::Constant(1, kPoints, -0.7);
  Matrix actions(1, kPoints);
  for (int i = 0; i < kPoints; ++i) actions(0, i) = -1 + (i + 0.5) * 2 / kPoints;
  Vector log_prob;
  GaussianGradient<double> unused;
  TanhLogProb<double>({mean, log_std}, actions, &log_prob, &unused);
  EXPECT_NEAR(log_prob.array().exp().sum() * 2 / kPoints, 1.0, 1e-4);
}

}  // namespace
}  // namespace dbr
