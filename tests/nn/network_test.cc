// Tests the MLP, Adam, the categorical policy and acting against reference values from PyTorch in double and
// against central differences.
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
    MlpParameterGradient<double>(shape, parameters.data(), x, dy, &activations, &gradient);
    ExpectNear(gradient, expected_gradient);
    Matrix dx;
    MlpInputGradient<double>(shape, parameters.data(), dy, &activations, &dx);
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
  MlpParameterGradient<double>(shape, parameters.data(), x, dy, &activations, &gradient);
  ExpectIsGradient(
      gradient, [&](const Matrix& p) { return loss(p.data(), x); }, parameters);
  Matrix dx;
  MlpInputGradient<double>(shape, parameters.data(), dy, &activations, &dx);
  ExpectIsGradient(
      dx, [&](const Matrix& input) { return loss(parameters.data(), input); }, x);
  Matrix dx_of_deltas;
  MlpParameterGradient<double>(shape, parameters.data(), x, dy, &activations, &gradient);
  MlpInputGradientOfDeltas<double>(shape, parameters.data(), dy, activations, &dx_of_deltas);
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
  MlpInputGradient<double>(shape, parameters.data(), dy, &activations, &expected);
  for (Eigen::Index j = 0; j < 900; ++j) {
    if (rng.Uniform() < 0.5 || (j >= 256 && j < 512)) {
      dy.col(j).setZero();
      expected.col(j).setZero();
    }
  }
  MlpInputGradient<double>(shape, parameters.data(), dy, &activations, &dx);
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

TEST(Polyak, MovesTheTargetByTau) {
  const Vector online = Vector::Constant(3, 2.0);
  Vector target = Vector::Constant(3, 1.0);
  PolyakUpdate<double>(online, 0.25, &target);
  EXPECT_EQ(target, Vector::Constant(3, 1.25));
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

// Makes a policy without hidden layers whose outputs are its biases.
std::vector<float> Constant(const std::vector<float>& outputs) {
  std::vector<float> parameters(outputs.size(), 0.0f);  // weights [out x 1]
  parameters.insert(parameters.end(), outputs.begin(), outputs.end());
  return parameters;
}

PolicySnapshot FourChoices() {
  PolicySnapshot snapshot;
  snapshot.version = 1;
  snapshot.spec = {.env = "test",
                   .algorithm = "dbr",
                   .observation_size = 1,
                   .actions = {ActionKind::kDiscrete, 4},
                   .hidden_sizes = {}};
  const auto logs = [](std::vector<float> p) {
    for (float& x : p) x = std::log(x);
    return Constant(p);
  };
  snapshot.networks = {{kPolicyNetwork, logs({0.4f, 0.3f, 0.2f, 0.1f})},
                       {kCritic1, Constant({0.1f, 0.2f, 0.6f, 0.9f})},
                       {kCritic2, Constant({0.3f, 0.2f, 0.5f, 0.8f})},
                       {kBetaPlus, logs({0.50f, 0.04f, 0.40f, 0.06f})},
                       {kBetaMinus, logs({0.20f, 0.10f, 0.10f, 0.60f})}};
  return snapshot;
}

class Acting : public testing::Test {
 protected:
  float Act(ActingMode mode, const std::vector<float>& mask) {
    const auto policy = PolicyNetworks::Create(snapshot_);
    EXPECT_TRUE(policy.ok()) << policy.status();
    const MatrixX<float> observation = MatrixX<float>::Zero(1, 1);
    const MatrixX<float> masks = Eigen::Map<const MatrixX<float>>(mask.data(), 4, 1);
    MatrixX<float> action(1, 1);
    status_ = runner_.Act(**policy, mode, observation, masks, rng_, action);
    return action(0, 0);
  }

  PolicySnapshot snapshot_ = FourChoices();
  PolicyRunner runner_;
  Rng rng_{1};
  absl::Status status_;
};

TEST_F(Acting, EachModeChoosesByItsOwnRule) {
  EXPECT_EQ(Act(MODE, {1, 1, 1, 1}), 0);
  EXPECT_EQ(Act(GREEDY_Q, {1, 1, 1, 1}), 3);
  EXPECT_EQ(Act(SUPPORT, {1, 1, 1, 1}), 2);  // 3 has the greatest Q, but beta- is above beta+ there
}

TEST_F(Acting, MasksHoldInEachMode) {
  EXPECT_EQ(Act(MODE, {0, 1, 1, 1}), 1);
  EXPECT_EQ(Act(GREEDY_Q, {1, 1, 1, 0}), 2);
  EXPECT_EQ(Act(SUPPORT, {0, 1, 0, 1}), 1);  // no action is supported, so it takes the greatest ratio
  for (int i = 0; i < 200; ++i) EXPECT_EQ(Act(SAMPLE, {0, 0, 1, 0}), 2);
}

TEST_F(Acting, SamplesByTheProbabilities) {
  int counts[4] = {};
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) ++counts[static_cast<int>(Act(SAMPLE, {1, 1, 1, 0}))];
  EXPECT_EQ(counts[3], 0);
  EXPECT_NEAR(counts[0], kDraws * 4.0 / 9, 5 * std::sqrt(kDraws * 0.25));
  EXPECT_NEAR(counts[2], kDraws * 2.0 / 9, 5 * std::sqrt(kDraws * 0.25));
}

TEST_F(Acting, AdvantageIsTheSmallerTwinLessItsMeanUnderThePolicy) {
  Act(SAMPLE, {1, 1, 1, 1});
  MatrixX<float> action(1, 1);
  action << 2;
  VectorX<float> advantage(1);
  runner_.Advantages(action, rng_, advantage);
  EXPECT_NEAR(advantage[0], 0.5 - (0.4 * 0.1 + 0.3 * 0.2 + 0.2 * 0.5 + 0.1 * 0.8), 1e-6);
}

TEST_F(Acting, TheValueOfAStateIsTheSmallerTwinsMeanUnderThePolicy) {
  const auto policy = PolicyNetworks::Create(snapshot_);
  MatrixX<float> masks = MatrixX<float>::Ones(4, 2);
  masks(3, 1) = masks(2, 1) = 0;
  VectorX<float> values(2);
  runner_.Values(**policy, MatrixX<float>::Zero(1, 2), masks, rng_, values);
  EXPECT_NEAR(values[0], 0.4 * 0.1 + 0.3 * 0.2 + 0.2 * 0.5 + 0.1 * 0.8, 1e-6);
  EXPECT_NEAR(values[1], (0.4 * 0.1 + 0.3 * 0.2) / 0.7, 1e-6);
  snapshot_.networks.resize(1);
  runner_.Values(**PolicyNetworks::Create(snapshot_), MatrixX<float>::Zero(1, 2), masks, rng_, values);
  EXPECT_TRUE(std::isnan(values[0]) && std::isnan(values[1]));
}

TEST_F(Acting, AMissingNetworkIsNamed) {
  snapshot_.networks.resize(1);
  Act(GREEDY_Q, {1, 1, 1, 1});
  EXPECT_THAT(std::string(status_.message()), testing::HasSubstr("critics"));
  Act(SAMPLE, {1, 1, 1, 1});
  EXPECT_TRUE(status_.ok());
  VectorX<float> advantage(1);
  runner_.Advantages(MatrixX<float>::Zero(1, 1), rng_, advantage);
  EXPECT_TRUE(std::isnan(advantage[0]));
}

TEST_F(Acting, ANetworkOfAnotherSizeIsRefusedByName) {
  snapshot_.networks[2].second.pop_back();
  const auto policy = PolicyNetworks::Create(snapshot_);
  EXPECT_THAT(std::string(policy.status().message()),
              testing::AllOf(testing::HasSubstr("critic_2"), testing::HasSubstr("expected 8"),
                             testing::HasSubstr("found 7")));
}

TEST_F(Acting, ValuesThatAreNotFiniteAreAnError) {
  const PolicySnapshot sound = snapshot_;
  for (std::size_t network = 0; network < sound.networks.size(); ++network) {
    snapshot_ = sound;
    snapshot_.networks[network].second.back() = NAN;
    Act(SUPPORT, {1, 1, 1, 1});  // it needs them all
    EXPECT_TRUE(absl::IsInternal(status_)) << sound.networks[network].first << ": " << status_;
  }
}

TEST_F(Acting, ACriticThatIsNotFiniteJudgesNothing) {
  const PolicySnapshot sound = snapshot_;
  for (const std::size_t critic : {1, 2}) {
    snapshot_ = sound;
    snapshot_.networks[critic].second.back() = NAN;
    VectorX<float> values(1);
    runner_.Values(**PolicyNetworks::Create(snapshot_), MatrixX<float>::Zero(1, 1),
                   MatrixX<float>::Ones(4, 1), rng_, values);
    EXPECT_TRUE(std::isnan(values[0])) << "critic " << critic;
  }
}

// A policy over one continuous action without hidden layers.
PolicySnapshot OneDimension() {
  PolicySnapshot snapshot;
  snapshot.version = 1;
  snapshot.spec = {.env = "test",
                   .algorithm = "sac",
                   .observation_size = 1,
                   .actions = {ActionKind::kContinuous, 1},
                   .hidden_sizes = {}};
  snapshot.networks = {{kPolicyNetwork, Constant({0, 0})},
                       {kCritic1, {0.0f, 1.0f, 0.0f}},  // weights of the observation and the action, bias
                       {kCritic2, {0.0f, 1.0f, 0.0f}}};
  return snapshot;
}

TEST(ContinuousActing, ByQAValueThatIsNotFiniteIsAnError) {
  PolicySnapshot snapshot = OneDimension();
  PolicyRunner runner;
  Rng rng(1);
  const MatrixX<float> observations = MatrixX<float>::Zero(1, 2), masks(0, 2);
  MatrixX<float> actions(1, 2);
  ASSERT_TRUE(
      runner.Act(**PolicyNetworks::Create(snapshot), GREEDY_Q, observations, masks, rng, actions).ok());
  snapshot.networks[1].second.back() = NAN;
  const absl::Status status =
      runner.Act(**PolicyNetworks::Create(snapshot), GREEDY_Q, observations, masks, rng, actions);
  EXPECT_TRUE(absl::IsInternal(status)) << status;
  EXPECT_TRUE(runner.Act(**PolicyNetworks::Create(snapshot), MODE, observations, masks, rng, actions).ok())
      << "by the policy alone no critic is asked";
}

TEST(ContinuousActing, ACriticThatIsNotFiniteJudgesNothing) {
  for (const std::size_t critic : {1, 2}) {
    PolicySnapshot snapshot = OneDimension();
    snapshot.networks[critic].second.back() = NAN;
    const auto policy = PolicyNetworks::Create(snapshot);
    PolicyRunner runner;
    Rng rng(1);
    const MatrixX<float> observations = MatrixX<float>::Zero(1, 1), masks(0, 1);
    MatrixX<float> actions(1, 1);
    ASSERT_TRUE(runner.Act(**policy, MODE, observations, masks, rng, actions).ok());
    VectorX<float> advantages(1), values(1);
    runner.Advantages(actions, rng, advantages);
    EXPECT_TRUE(std::isnan(advantages[0])) << "critic " << critic;
    runner.Values(**policy, observations, masks, rng, values);
    EXPECT_TRUE(std::isnan(values[0])) << "critic " << critic;
  }
}

}  // namespace
}  // namespace dbr
