// Tests networks whose products are made in bfloat16 against the same networks in float32.
#include "nn/precision.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "nn/mlp.h"
#include "nn/product/product_library.h"

namespace dbr {
namespace {

using Matrix = MatrixX<float>;

Matrix Normal(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  Matrix matrix(rows, cols);
  for (float& value : matrix.reshaped()) value = static_cast<float>(rng.Normal());
  return matrix;
}

// |a - b| / |b|.
double RelativeError(const Matrix& a, const Matrix& b) {
  return (a - b).norm() / b.norm();
}

struct Case {
  std::vector<int> hidden;
  Eigen::Index n;
  bool layer_norm = false;
};

class Bfloat16Network : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!HasBfloat16()) GTEST_SKIP() << "the processor has no bfloat16";
  }
};

// Eight bits of mantissa: each rounded number is off by 2^-9 at most, and a layer adds such errors of many
// numbers, which cancel in part. Gradients are off by more, because some hidden units fire in one precision
// alone.
constexpr double kOutputTolerance = 0.02, kGradientTolerance = 0.1;

TEST_P(Bfloat16Network, AgreesWithFloat32) {
  Rng rng(5);
  const MlpShape shape(36, GetParam().hidden, 5, GetParam().layer_norm);
  VectorX<float> parameters = InitialParameters<float>(shape, rng);
  for (int layer = 0; layer + 1 < shape.layer_count() && shape.layer_norm(); ++layer) {
    auto vectors = parameters.segment(shape.gain_offset(layer), 2 * shape.out(layer));
    vectors += 0.2f * Normal(vectors.size(), 1, rng);
  }
  RoundedWeights rounded(shape);
  rounded.RoundAll(shape, parameters.data());
  const MlpParameters<float> full(parameters), reduced(parameters.data(), &rounded);
  const Eigen::Index n = GetParam().n;
  const Matrix x = Normal(36, n, rng);
  Matrix dy = Normal(5, n, rng);
  for (Eigen::Index j = 0; j < n; ++j) {
    if (n > 2 && (j % 3 == 0 || (j >= 256 && j < 512))) dy.col(j).setZero();  // a block without a gradient
  }
  MlpActivations<float> activations;  // both passes have their own part of it
  const Matrix y = MlpForward<float>(shape, full, x, &activations);
  EXPECT_LT(RelativeError(MlpForward<float>(shape, reduced, x, &activations), y), kOutputTolerance);

  VectorX<float> gradient, gradient16;
  MlpParameterGradient<float>(full, x, dy, &activations, &gradient);
  MlpParameterGradient<float>(reduced, x, dy, &activations, &gradient16);
  EXPECT_LT(RelativeError(gradient16, gradient), kGradientTolerance);
  Matrix of_deltas, of_deltas16;
  MlpInputGradientOfDeltas<float>(full, dy, &activations, &of_deltas);
  MlpInputGradientOfDeltas<float>(reduced, dy, &activations, &of_deltas16);
  EXPECT_LT(RelativeError(of_deltas16, of_deltas), kGradientTolerance);
  for (const Eigen::Index rows : {Eigen::Index{8}, Eigen::Index{36}}) {
    Matrix dx, dx16;
    MlpInputGradient<float>(full, dy, rows, &activations, &dx);
    MlpInputGradient<float>(reduced, dy, rows, &activations, &dx16);
    EXPECT_LT(RelativeError(dx16, dx), kGradientTolerance);
    EXPECT_LT(RelativeError(dx, of_deltas.bottomRows(rows)), 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Networks, Bfloat16Network,
                         testing::Values(Case{{}, 1}, Case{{}, 300}, Case{{6}, 5}, Case{{256, 256, 256}, 1},
                                         Case{{256, 256, 256}, 256}, Case{{256, 256}, 600},
                                         Case{{50, 33}, 100}, Case{{6}, 5, true},
                                         Case{{256, 256, 256}, 256, true}, Case{{50, 33}, 600, true}));

// One workspace may serve networks of different shapes in turn, as an actor's does.
TEST(MlpActivationsTest, ServeNetworksOfTwoShapesInTurn) {
  Rng rng(6);
  const MlpShape first(7, {20, 30}, 2), second(7, {10}, 2);
  const VectorX<float> a = InitialParameters<float>(first, rng), b = InitialParameters<float>(second, rng);
  const Matrix x = Normal(7, 9, rng);
  MlpActivations<float> shared, alone_a, alone_b;
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(MlpForward<float>(first, a.data(), x, &shared),
              MlpForward<float>(first, a.data(), x, &alone_a));
    EXPECT_EQ(MlpForward<float>(second, b.data(), x, &shared),
              MlpForward<float>(second, b.data(), x, &alone_b));
  }
}

// Rows that are padding for one network hold numbers of another: a NaN among them must not stay.
TEST(MlpActivationsTest, ABrokenNetworkLeavesNothingToTheNext) {
  if (!HasBfloat16()) GTEST_SKIP() << "the processor has no bfloat16";
  Rng rng(6);
  const MlpShape wide(7, {30}, 2), narrow(7, {20}, 2);
  const VectorX<float> broken = VectorX<float>::Constant(wide.parameter_count(), NAN);
  const VectorX<float> sound = InitialParameters<float>(narrow, rng);
  RoundedWeights of_broken(wide), of_sound(narrow);
  of_broken.RoundAll(wide, broken.data());
  of_sound.RoundAll(narrow, sound.data());
  const Matrix x = Normal(7, 9, rng);
  MlpActivations<float> activations;
  MlpForward<float>(wide, {broken.data(), &of_broken}, x, &activations);
  EXPECT_TRUE(MlpForward<float>(narrow, {sound.data(), &of_sound}, x, &activations).allFinite());
}

TEST(PrecisionTest, AsksForBfloat16WhereTheProcessorHasIt) {
  NetworkConfig config;
  EXPECT_EQ(config.precision(), NetworkConfig::AUTO);
  EXPECT_EQ(*UsesBfloat16(config), HasBfloat16());
  config.set_precision(NetworkConfig::FLOAT32);
  EXPECT_FALSE(*UsesBfloat16(config));
  config.set_precision(NetworkConfig::BFLOAT16);
  const absl::StatusOr<bool> by_name = UsesBfloat16(config);
  EXPECT_EQ(by_name.ok(), HasBfloat16());
  if (by_name.ok()) return;
  EXPECT_TRUE(absl::IsInvalidArgument(by_name.status()));
  EXPECT_THAT(std::string(by_name.status().message()),
              testing::AllOf(testing::HasSubstr("avx512_bf16"), testing::HasSubstr(ProcessorInstructions()),
                             testing::HasSubstr("AUTO or FLOAT32")));
}

}  // namespace
}  // namespace dbr
