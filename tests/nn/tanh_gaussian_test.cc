// Tests the tanh-Gaussian's samples, likelihoods and gradients against reference values from PyTorch in
// double and against central differences.
#include "nn/tanh_gaussian.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "tests/nn/gaussian_cases.h"

namespace dbr {
namespace {

using Json = nlohmann::json;
using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

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
