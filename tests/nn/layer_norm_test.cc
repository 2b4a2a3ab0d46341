// Tests networks with normalised hidden layers against the definition and against central differences.
#include "nn/layer_norm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/mlp.h"
#include "nn/policy_networks.h"
#include "nn/product/product_library.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

constexpr int kInputs = 4, kOutputs = 3;

Matrix Uniform(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  Matrix matrix(rows, cols);
  for (double& value : matrix.reshaped()) value = 2 * rng.Uniform() - 1;
  return matrix;
}

// Parameters whose gains, of both signs, and shifts are not those of a new network.
Vector TrainedParameters(const MlpShape& shape, Rng& rng) {
  Vector parameters = InitialParameters<double>(shape, rng);
  for (int layer = 0; layer + 1 < shape.layer_count(); ++layer) {
    auto vectors = parameters.segment(shape.gain_offset(layer), 2 * shape.out(layer));
    vectors += 2 * Uniform(vectors.size(), 1, rng);
  }
  return parameters;
}

// The network's output as its definition says it, sample by sample.
Matrix Definition(const MlpShape& shape, const Vector& parameters, const Matrix& x) {
  Matrix y = x;
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    const Eigen::Index out = shape.out(layer);
    const Eigen::Map<const Matrix> weight(parameters.data() + shape.weight_offset(layer), out,
                                          shape.in(layer));
    y = ((weight * y).colwise() + parameters.segment(shape.bias_offset(layer), out)).eval();
    if (layer + 1 == shape.layer_count()) return y;
    for (Eigen::Index j = 0; j < y.cols(); ++j) {
      const double mean = y.col(j).mean();
      const double variance = (y.col(j).array() - mean).square().mean();
      for (Eigen::Index i = 0; i < out; ++i) {
        const double normalized = (y(i, j) - mean) / std::sqrt(variance + 1e-5);
        const double gain = parameters[shape.gain_offset(layer) + i];
        y(i, j) = std::max(0.0, gain * normalized + parameters[shape.shift_offset(layer) + i]);
      }
    }
  }
  return y;
}

// Widths below and above a vector register, and between multiples of them.
class LayerNormTest : public testing::TestWithParam<std::vector<int>> {
 protected:
  LayerNormTest()
      : shape_(kInputs, GetParam(), kOutputs, /*layer_norm=*/true),
        parameters_(TrainedParameters(shape_, rng_)) {}

  Rng rng_{3};
  const MlpShape shape_;
  const Vector parameters_;
  MlpActivations<double> activations_;
};

TEST_P(LayerNormTest, ForwardAgreesWithTheDefinition) {
  const Matrix x = Uniform(kInputs, 300, rng_);  // two blocks of columns
  ExpectNear(MlpForward<double>(shape_, parameters_.data(), x, &activations_),
             Definition(shape_, parameters_, x));
}

TEST_P(LayerNormTest, GradientsAgreeWithDifferences) {
  const Matrix x = Uniform(kInputs, 5, rng_), dy = Uniform(kOutputs, 5, rng_);
  const auto loss = [&](const double* parameters, const Matrix& input) {
    MlpActivations<double> scratch;
    return MlpForward<double>(shape_, parameters, input, &scratch).cwiseProduct(dy).sum();
  };
  MlpForward<double>(shape_, parameters_.data(), x, &activations_);
  Vector gradient;
  MlpParameterGradient<double>(parameters_.data(), x, dy, &activations_, &gradient);
  ExpectIsGradient(
      gradient, [&](const Matrix& p) { return loss(p.data(), x); }, parameters_);
  Matrix of_deltas, dx;
  MlpInputGradientOfDeltas<double>(parameters_.data(), dy, &activations_, &of_deltas);
  MlpInputGradient<double>(parameters_.data(), dy, kInputs, &activations_, &dx);
  ExpectIsGradient(
      dx, [&](const Matrix& input) { return loss(parameters_.data(), input); }, x);
  ExpectNear(of_deltas, dx);
}

TEST_P(LayerNormTest, SamplesWithoutAGradientHaveNoneForTheirInput) {
  const Matrix x = Uniform(kInputs, 900, rng_);
  Matrix dy = Uniform(kOutputs, 900, rng_);
  MlpForward<double>(shape_, parameters_.data(), x, &activations_);
  Matrix expected, dx;
  MlpInputGradient<double>(parameters_.data(), dy, kInputs, &activations_, &expected);
  for (Eigen::Index j = 0; j < 900; ++j) {
    if (rng_.Uniform() > 0.5 && (j < 256 || j >= 512)) continue;
    dy.col(j).setZero();
    expected.col(j).setZero();
  }
  MlpInputGradient<double>(parameters_.data(), dy, kInputs, &activations_, &dx);
  ExpectNear(dx, expected);
}

TEST_P(LayerNormTest, Float32AgreesWithDouble) {
  const Matrix x = Uniform(kInputs, 40, rng_), dy = Uniform(kOutputs, 40, rng_);
  const VectorX<float> parameters = parameters_.cast<float>();
  MlpActivations<float> activations;
  const MatrixX<float> y = MlpForward<float>(shape_, parameters.data(), x.cast<float>(), &activations);
  VectorX<float> gradient;
  MlpParameterGradient<float>(parameters.data(), x.cast<float>(), dy.cast<float>(), &activations, &gradient);
  ExpectNear(y.cast<double>(), MlpForward<double>(shape_, parameters_.data(), x, &activations_), 1e-4);
  Vector expected;
  MlpParameterGradient<double>(parameters_.data(), x, dy, &activations_, &expected);
  EXPECT_LT((gradient.cast<double>() - expected).norm(), 1e-3 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(Widths, LayerNormTest,
                         testing::Values(std::vector<int>{2}, std::vector<int>{33},
                                         std::vector<int>{5, 19, 8}));

TEST(LayerNormShapeTest, GainAndShiftFollowEachHiddenBias) {
  const MlpShape shape(4, {6, 5}, 3, /*layer_norm=*/true), plain(4, {6, 5}, 3);
  EXPECT_EQ(shape.gain_offset(0), 4 * 6 + 6);
  EXPECT_EQ(shape.shift_offset(0), 4 * 6 + 2 * 6);
  EXPECT_EQ(shape.weight_offset(1), 4 * 6 + 3 * 6);
  EXPECT_EQ(shape.vector_count(1), 15);
  EXPECT_EQ(shape.vector_count(2), 3) << "the output is not normalised";
  EXPECT_EQ(shape.parameter_count(), plain.parameter_count() + 2 * (6 + 5));
  EXPECT_FALSE(shape == plain);
  EXPECT_EQ(plain.parameter_count(), 4 * 6 + 6 + 6 * 5 + 5 + 5 * 3 + 3);
}

TEST(LayerNormShapeTest, TheRestOfANewNetworkIsThatOfOneWithout) {
  const MlpShape shape(4, {6, 5}, 3, /*layer_norm=*/true), plain(4, {6, 5}, 3);
  Rng rng(8), same(8);
  const Vector parameters = InitialParameters<double>(shape, rng);
  const Vector without = InitialParameters<double>(plain, same);
  for (int layer = 0; layer < 3; ++layer) {
    const Eigen::Index n = (plain.in(layer) + 1) * plain.out(layer);
    EXPECT_EQ(parameters.segment(shape.weight_offset(layer), n),
              without.segment(plain.weight_offset(layer), n));
    if (layer == 2) break;
    EXPECT_TRUE((parameters.segment(shape.gain_offset(layer), shape.out(layer)).array() == 1).all());
    EXPECT_TRUE((parameters.segment(shape.shift_offset(layer), shape.out(layer)).array() == 0).all());
  }
}

TEST(LayerNormShapeTest, OfAPolicysNetworksTheCriticsAloneAreNormalised) {
  for (const ActionKind kind : {ActionKind::kDiscrete, ActionKind::kContinuous}) {
    PolicySpec spec;
    spec.observation_size = 5;
    spec.actions = {kind, 3};
    spec.hidden_sizes = {8};
    EXPECT_FALSE(CriticShape(spec).layer_norm());
    const Eigen::Index before = CriticShape(spec).parameter_count();
    spec.critic_layer_norm = true;
    EXPECT_TRUE(CriticShape(spec).layer_norm());
    EXPECT_EQ(CriticShape(spec).parameter_count(), before + 16);
    EXPECT_FALSE(PolicyShape(spec).layer_norm());
  }
}

// The mean of the squares less the square of the mean would leave nothing of the variance here.
TEST(LayerNormValuesTest, SumsFarFromZeroKeepTheirVariance) {
  const int units = 37;
  LayerNorm<float> norm;
  norm.Resize(units, 1);
  const Columns<float> z = norm.Sums(0, 1);
  const VectorX<float> gain = VectorX<float>::Ones(units), shift = VectorX<float>::Constant(units, 10);
  VectorX<float> y(units);
  for (int i = 0; i < units; ++i) z.values[i] = 10000.0f + static_cast<float>(i % 2);
  norm.Forward({gain.data(), shift.data()}, 0, {y.data(), units, 1, units});
  const double mean = 18.0 / 37, deviation = std::sqrt(mean * (1 - mean) + 1e-5);
  for (int i = 0; i < units; ++i) EXPECT_NEAR(y[i], 10 + (i % 2 - mean) / deviation, 2e-3) << i;
}

TEST(LayerNormValuesTest, EqualSumsBecomeTheShift) {
  for (const int units : {1, 7, 64}) {
    LayerNorm<float> norm;
    norm.Resize(units, 1);
    const Columns<float> z = norm.Sums(0, 1);
    std::fill_n(z.values, units, 3.7f);
    const VectorX<float> gain = VectorX<float>::Constant(units, 2),
                         shift = VectorX<float>::Constant(units, 0.5f);
    VectorX<float> y(units);
    norm.Forward({gain.data(), shift.data()}, 0, {y.data(), units, 1, units});
    EXPECT_EQ(y, shift) << units;
  }
}

// A NaN among the parameters of a hidden unit reaches the output, in each precision: nothing takes it for 0.
TEST(LayerNormValuesTest, ANaNOfAHiddenUnitReachesTheOutput) {
  for (const int width : {1, 3, 16, 21}) {
    const MlpShape shape(2, {width, width}, 1, /*layer_norm=*/true);
    for (int unit = 0; unit < width; ++unit) {
      for (const int layer : {0, 1}) {
        for (const Eigen::Index offset :
             {shape.bias_offset(layer), shape.gain_offset(layer), shape.shift_offset(layer)}) {
          VectorX<float> parameters = VectorX<float>::Constant(shape.parameter_count(), 0.5f);
          parameters[offset + unit] = NAN;
          MlpActivations<float> activations;
          const MatrixX<float> x = MatrixX<float>::Ones(2, 1);
          EXPECT_TRUE(std::isnan(MlpForward<float>(shape, parameters.data(), x, &activations)(0, 0)))
              << "unit " << unit << " of " << width << " at " << offset;
          if (!HasBfloat16()) continue;
          RoundedWeights rounded(shape);
          rounded.RoundAll(shape, parameters.data());
          EXPECT_TRUE(
              std::isnan(MlpForward<float>(shape, {parameters.data(), &rounded}, x, &activations)(0, 0)))
              << "bfloat16, unit " << unit << " of " << width << " at " << offset;
        }
      }
    }
  }
}

// One workspace may serve networks with and without normalisation in turn, as an actor's does.
TEST(LayerNormValuesTest, OneWorkspaceServesBothKindsInTurn) {
  Rng rng(6);
  const MlpShape normalized(kInputs, {20}, 2, /*layer_norm=*/true), plain(kInputs, {20}, 2);
  const Vector a = TrainedParameters(normalized, rng), b = InitialParameters<double>(plain, rng);
  const Matrix x = Uniform(kInputs, 9, rng);
  MlpActivations<double> shared, alone_a, alone_b;
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(MlpForward<double>(normalized, a.data(), x, &shared),
              MlpForward<double>(normalized, a.data(), x, &alone_a));
    EXPECT_EQ(MlpForward<double>(plain, b.data(), x, &shared),
              MlpForward<double>(plain, b.data(), x, &alone_b));
  }
}

}  // namespace
}  // namespace dbr
