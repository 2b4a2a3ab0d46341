// Tests the MLP, Adam and the categorical policy against reference values from PyTorch in double and against
// central differences.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "nn/adam.h"
#include "nn/categorical.h"
#include "nn/gaussian_head.h"
#include "nn/mlp.h"
#include "nn/policy.h"
#include "tests/support/numeric.h"
#include "tests/support/reference_json.h"

namespace dbr {
namespace {

using Json = nlohmann::json;
using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

Matrix Uniform(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  Matrix matrix(rows, cols);
  for (double& value : matrix.reshaped()) value = 2 * rng.Uniform() - 1;
  return matrix;
}

TEST(Mlp, AgreesWithTheReference) {
  int cases = 0;
  for (const ReferenceFile& file : ReferenceFiles("losses", "losses")) {
    const Json& mlp = file.json["mlp"];
    std::vector<int> sizes = {static_cast<int>(mlp["layers"][0]["weight"][0].size())};
    for (const Json& layer : mlp["layers"]) sizes.push_back(static_cast<int>(layer["bias"].size()));
    const MlpShape shape(sizes.front(), {sizes.begin() + 1, sizes.end() - 1}, sizes.back());
    Vector parameters(shape.parameter_count()), expected_gradient(shape.parameter_count());
    for (int i = 0; i < shape.layer_count(); ++i) {
      const Json& layer = mlp["layers"][i];
      const auto put = [&](const char* weight, const char* bias, Vector* flat) {
        // ToMatrix turns [out][in] into [in x out].
        const Matrix w = ToMatrix(layer[weight]).transpose();
        flat->segment(shape.weight_offset(i), w.size()) = w.reshaped();
        flat->segment(shape.bias_offset(i), shape.out(i)) = ToVector(layer[bias]);
      };
      put("weight", "bias", &parameters);
      put("grad_weight", "grad_bias", &expected_gradient);
    }
    MlpActivations<double> activations;
    const Matrix x = ToMatrix(mlp["x"]), dy = ToMatrix(mlp["dy"]);
    ExpectNear(MlpForward<double>(shape, parameters.data(), x, &activations), ToMatrix(mlp["y"]));
    Vector gradient;
    MlpParameterGradient<double>(parameters.data(), x, dy, &activations, &gradient);
    ExpectNear(gradient, expected_gradient);
    Matrix dx;
    MlpInputGradient<double>(parameters.data(), dy, shape.input_size(), &activations, &dx);
    ExpectNear(dx, ToMatrix(mlp["grad_x"]));
    ++cases;
  }
  EXPECT_GT(cases, 0);
}

class MlpDepth : public testing::TestWithParam<std::vector<int>> {};

TEST_P(MlpDepth, GradientsAgreeWithDifferences) {
  Rng rng(3);
  const MlpShape shape(4, GetParam(), 3);
  const Vector parameters = InitialParameters<double>(shape, rng);
  const Matrix x = Uniform(4, 5, rng), dy = Uniform(3, 5, rng);
  MlpActivations<double> activations;
  const auto loss = [&](const double* p, const Matrix& input) {
    MlpActivations<double> scratch;
    return MlpForward<double>(shape, p, input, &scratch).cwiseProduct(dy).sum();
  };
  MlpForward<double>(shape, parameters.data(), x, &activations);
  Vector gradient;
  MlpParameterGradient<double>(parameters.data(), x, dy, &activations, &gradient);
  ExpectIsGradient(
      gradient, [&](const Matrix& p) { return loss(p.data(), x); }, parameters);
  Matrix dx;
  MlpInputGradient<double>(parameters.data(), dy, shape.input_size(), &activations, &dx);
  ExpectIsGradient(
      dx, [&](const Matrix& input) { return loss(parameters.data(), input); }, x);
  Matrix dx_of_deltas;
  MlpParameterGradient<double>(parameters.data(), x, dy, &activations, &gradient);
  MlpInputGradientOfDeltas<double>(parameters.data(), dy, &activations, &dx_of_deltas);
  ExpectNear(dx_of_deltas, dx);
}

// Uses several blocks of columns, one of them without any gradient.
TEST_P(MlpDepth, SamplesWithoutAGradientHaveNoneForTheirInput) {
  Rng rng(4);
  const MlpShape shape(4, GetParam(), 3);
  const Vector parameters = InitialParameters<double>(shape, rng);
  const Matrix x = Uniform(4, 900, rng);
  Matrix dy = Uniform(3, 900, rng);
  MlpActivations<double> activations;
  MlpForward<double>(shape, parameters.data(), x, &activations);
  Matrix expected, dx;
  MlpInputGradient<double>(parameters.data(), dy, shape.input_size(), &activations, &expected);
  for (Eigen::Index j = 0; j < 900; ++j) {
    if (rng.Uniform() < 0.5 || (j >= 256 && j < 512)) {
      dy.col(j).setZero();
      expected.col(j).setZero();
    }
  }
  MlpInputGradient<double>(parameters.data(), dy, shape.input_size(), &activations, &dx);
  ExpectNear(dx, expected);
}

INSTANTIATE_TEST_SUITE_P(Depths, MlpDepth,
                         testing::Values(std::vector<int>{}, std::vector<int>{6}, std::vector<int>{5, 7, 6}));

// A ReLU that took the greater of a NaN and 0 as 0 would make a broken network look sound.
TEST(Mlp, ANaNOfAHiddenUnitReachesTheOutput) {
  for (const int width : {1, 3, 8, 13}) {  // with and without whole vector registers
    const MlpShape shape(2, {width, width}, 1);
    for (int unit = 0; unit < width; ++unit) {
      for (const int layer : {0, 1}) {
        VectorX<float> parameters = VectorX<float>::Constant(shape.parameter_count(), 0.5f);
        parameters[shape.bias_offset(layer) + unit] = NAN;
        MlpActivations<float> activations;
        const MatrixX<float> x = MatrixX<float>::Ones(2, 1);
        EXPECT_TRUE(std::isnan(MlpForward<float>(shape, parameters.data(), x, &activations)(0, 0)))
            << "unit " << unit << " of " << width;
      }
    }
  }
}

TEST(GaussianHeadTest, ANaNIsNotClippedToALimit) {
  for (const int dimensions : {1, 3, 8, 13}) {
    MatrixX<float> output = MatrixX<float>::Zero(2 * dimensions, 1);
    output.bottomRows(dimensions).setConstant(NAN);
    GaussianHead<float> head;
    head.Split(output, kPolicyLogStd);
    EXPECT_TRUE(head.log_std().array().isNaN().all()) << dimensions;
  }
}

TEST(Mlp, CountsUsefulOperationsOfEachProductOnce) {
  const MlpShape shape(84, {256, 256, 256}, 7);
  const double products = 84 * 256 + 256 * 256 * 2 + 256 * 7;
  EXPECT_EQ(shape.ForwardFlops(256), 2 * 256 * products);
  EXPECT_EQ(shape.ParameterGradientFlops(256), 2 * 256 * (2 * products - 84 * 256));
}

TEST(Adam, AgreesWithTheReference) {
  int cases = 0;
  for (const ReferenceFile& file : ReferenceFiles("losses", "losses")) {
    Vector weights = ToVector(file.json["adam"]["start"]);
    Adam<double> adam(weights.size(), 3e-4);
    for (const Json& step : file.json["adam"]["steps"]) {
      adam.Step(ToVector(step["grad"]), &weights);
      ExpectNear(weights, ToVector(step["weights"]), 1e-12);
      ++cases;
    }
  }
  EXPECT_GT(cases, 0);
}

TEST(MaskedCategorical, AgreesWithTheReference) {
  int cases = 0;
  for (const ReferenceFile& file : ReferenceFiles("losses", "losses")) {
    for (const Json& reference : file.json["masked_categorical"]["cases"]) {
      Json legal = reference["legal"];
      for (Json& row : legal) {
        for (Json& entry : row) {
          if (entry.is_boolean()) entry = entry.get<bool>() ? 1 : 0;
        }
      }
      const Matrix mask = ToMatrix(legal);
      Categorical<double> p, q;
      MaskedSoftmax<double>(ToMatrix(reference["logits"]), mask, &p);
      MaskedSoftmax<double>(ToMatrix(reference["other_logits"]), mask, &q);
      ExpectNear(p.probabilities, ToMatrix(reference["probabilities"]));
      Vector kl, entropy;
      KlDivergence(p, q, &kl);
      Entropy(p, &entropy);
      ExpectNear(kl, ToVector(reference["kl"]));
      ExpectNear(entropy, ToVector(reference["entropy"]));
      Matrix gradient = p.log_probabilities - q.log_probabilities;
      SoftmaxGradient(p, &gradient);
      ExpectNear(gradient, ToMatrix(reference["grad_logits_of_kl_sum"]));
      gradient = -p.log_probabilities;
      SoftmaxGradient(p, &gradient);
      ExpectNear(gradient, ToMatrix(reference["grad_logits_of_entropy_sum"]));
      ++cases;
    }
  }
  EXPECT_GT(cases, 0);
}

TEST(MaskedCategorical, LikelihoodGradientAgreesWithDifferences) {
  Rng rng(5);
  const Matrix logits = Uniform(4, 3, rng);
  Matrix mask = Matrix::Ones(4, 3), actions(1, 3);
  mask(2, 0) = mask(0, 1) = 0;
  actions << 1, 3, 0;
  Categorical<double> p;
  MaskedSoftmax<double>(logits, mask, &p);
  Matrix gradient;
  NegativeLogLikelihood<double>(p, actions, &gradient);
  EXPECT_EQ(gradient(2, 0), 0);
  ExpectIsGradient(
      gradient,
      [&](const Matrix& z) {
        Categorical<double> moved;
        MaskedSoftmax<double>(z, mask, &moved);
        return NegativeLogLikelihood<double>(moved, actions, nullptr);
      },
      logits);
}

TEST(MaskedCategorical, WeightedLikelihoodHasItsGradientAndWeightsOfOneChangeNothing) {
  Rng rng(6);
  const Matrix logits = Uniform(4, 3, rng);
  Matrix mask = Matrix::Ones(4, 3), actions(1, 3);
  mask(2, 0) = 0;
  actions << 1, 3, 0;
  VectorX<double> weights(3), ones = VectorX<double>::Ones(3);
  weights << 2.5, 0, 0.5;
  Categorical<double> p;
  MaskedSoftmax<double>(logits, mask, &p);
  Matrix gradient, plain;
  NegativeLogLikelihood<double>(p, actions, &gradient, &weights);
  EXPECT_TRUE(gradient.col(1).isZero(0));
  ExpectIsGradient(
      gradient,
      [&](const Matrix& z) {
        Categorical<double> moved;
        MaskedSoftmax<double>(z, mask, &moved);
        return NegativeLogLikelihood<double>(moved, actions, nullptr, &weights);
      },
      logits);
  EXPECT_DOUBLE_EQ(NegativeLogLikelihood<double>(p, actions, &gradient, &ones),
                   NegativeLogLikelihood<double>(p, actions, &plain));
  EXPECT_EQ(gradient, plain);
}

TEST(MaskedCategorical, AColumnWithoutLegalActionsIsZero) {
  Categorical<double> p;
  MaskedSoftmax<double>(Matrix::Ones(3, 1), Matrix::Zero(3, 1), &p);
  EXPECT_TRUE(p.probabilities.isZero(0));
  EXPECT_TRUE(p.log_probabilities.isZero(0));
}

TEST(MaskedCategorical, ANaNReachesEveryLegalActionOfItsColumn) {
  MatrixX<float> logits = MatrixX<float>::Zero(3, 2), masks = MatrixX<float>::Ones(3, 2);
  logits(1, 0) = NAN;
  masks(2, 0) = 0;
  Categorical<float> p;
  MaskedSoftmax<float>(logits, masks, &p);
  for (const int action : {0, 1}) {
    EXPECT_TRUE(std::isnan(p.probabilities(action, 0))) << action;
    EXPECT_TRUE(std::isnan(p.log_probabilities(action, 0))) << action;
  }
  EXPECT_TRUE(p.probabilities.col(1).allFinite());
}

TEST(MaskedCategorical, StaysFiniteForLargeLogits) {
  Matrix logits(3, 1);
  logits << 1e5, -1e5, 3e4;
  Categorical<double> p;
  MaskedSoftmax<double>(logits, Matrix::Ones(3, 1), &p);
  EXPECT_TRUE(p.log_probabilities.allFinite());
  EXPECT_DOUBLE_EQ(p.probabilities(0, 0), 1);
}

}  // namespace
}  // namespace dbr
