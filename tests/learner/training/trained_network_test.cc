// Tests a network in training: its steps, its target, and that products read its newest parameters.
#include "learner/training/trained_network.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/rng.h"
#include "core/safetensors.h"
#include "nn/adam.h"
#include "nn/mlp.h"
#include "nn/product/product_library.h"

namespace dbr {
namespace {

using Network = TrainedNetwork<float>;

constexpr double kLearningRate = 1e-2;
constexpr double kTau = 0.125;
constexpr int kSamples = 40;

// Both precisions, and shapes whose parts of a step do not divide their weights.
struct NetworkCase {
  bool bfloat16;
  std::vector<int> hidden_sizes;
  bool layer_norm = false;
};

class TrainedNetworkTest : public testing::TestWithParam<NetworkCase> {
 protected:
  TrainedNetworkTest() : shape_(6, GetParam().hidden_sizes, 4, GetParam().layer_norm) {}
  void SetUp() override {
    if (GetParam().bfloat16 && !HasBfloat16()) {
      GTEST_SKIP() << "bfloat16 needs avx512_bf16 or amx_bf16, found " << ProcessorInstructions();
    }
    x_ = Uniform(6, kSamples);
    d_output_ = Uniform(4, kSamples);
  }

  MatrixX<float> Uniform(Eigen::Index rows, Eigen::Index cols) {
    MatrixX<float> matrix(rows, cols);
    for (float& value : matrix.reshaped()) value = static_cast<float>(2 * rng_.Uniform() - 1);
    return matrix;
  }
  // A network of the case's kind, whose target moves.
  Network Make(std::uint64_t seed) const {
    Rng rng(seed);
    Network network(
        shape_, {.learning_rate = kLearningRate, .with_target = true, .bfloat16 = GetParam().bfloat16}, rng);
    network.set_target_tau(kTau);
    return network;
  }
  // One step on the same samples.
  void Step(Network* network) {
    network->Forward(x_);
    network->Step(x_, d_output_);
  }

  // What a network made anew gives for `parameters`, with nothing kept from earlier ones: in bfloat16 it
  // rounds all weights afresh.
  MatrixX<float> OutputOf(const VectorX<float>& parameters) const {
    MlpActivations<float> activations;
    if (!GetParam().bfloat16) return MlpForward<float>(shape_, parameters.data(), x_, &activations);
    RoundedWeights rounded(shape_);
    rounded.RoundAll(shape_, parameters.data());
    return MlpForward<float>(shape_, {parameters.data(), &rounded}, x_, &activations);
  }
  void ExpectReadsItsParameters(Network* network) {
    EXPECT_EQ(network->Forward(x_), OutputOf(network->parameters())) << "online";
    EXPECT_EQ(network->Evaluate(x_), OutputOf(network->parameters())) << "online, evaluated";
    EXPECT_EQ(network->ForwardForInput(x_), OutputOf(network->parameters())) << "online, for its input";
    EXPECT_EQ(network->ForwardTarget(x_), OutputOf(network->target())) << "target";
  }

  MlpShape shape_;
  Rng rng_{21};
  MatrixX<float> x_, d_output_;  // [6 x kSamples], [4 x kSamples]
};

// ApplyGradient goes through the parameters in parts. Here is what it computes, vector by vector. The parts
// may round by one unit in the last place: compilers fuse a product and a sum in one of the two alone.
TEST_P(TrainedNetworkTest, AStepIsAdamAndThenMovesTheTarget) {
  Network network = Make(1);
  VectorX<float> parameters = network.parameters(), target = network.target();
  Adam<float> adam(shape_.parameter_count(), kLearningRate);
  for (int step = 0; step < 5; ++step) {
    network.Forward(x_);
    network.ComputeGradient(x_, d_output_);
    const VectorX<float> gradient = network.gradient();
    ASSERT_GT(gradient.norm(), 0);
    network.ApplyGradient();
    adam.Step(gradient, &parameters);
    target = target + static_cast<float>(kTau) * (parameters - target);
    const float moved = static_cast<float>(kLearningRate);
    EXPECT_LE((network.parameters() - parameters).cwiseAbs().maxCoeff(), 1e-5f * moved) << "step " << step;
    EXPECT_LE((network.target() - target).cwiseAbs().maxCoeff(), 1e-5f * moved) << "step " << step;
  }
  EXPECT_NE(network.parameters(), network.target());
}

TEST_P(TrainedNetworkTest, StepComputesTheGradientAndAppliesIt) {
  Network whole = Make(1), parts = Make(1);
  for (int step = 0; step < 3; ++step) {
    Step(&whole);
    parts.Forward(x_);
    parts.ComputeGradient(x_, d_output_);
    parts.ApplyGradient();
    EXPECT_EQ(whole.parameters(), parts.parameters());
    EXPECT_EQ(whole.target(), parts.target());
  }
}

TEST_P(TrainedNetworkTest, ATargetWithoutAShareStaysWhereItIs) {
  Network network = Make(1);
  network.set_target_tau(0);
  const VectorX<float> before = network.target();
  Step(&network);
  EXPECT_EQ(network.target(), before);
  EXPECT_NE(network.parameters(), before);
  ExpectReadsItsParameters(&network);
}

TEST_P(TrainedNetworkTest, ProductsReadTheFirstParameters) {
  Network network = Make(1);
  ExpectReadsItsParameters(&network);
}

TEST_P(TrainedNetworkTest, ProductsReadTheParametersAfterAStep) {
  Network network = Make(1);
  const MatrixX<float> before = network.Forward(x_), target_before = network.ForwardTarget(x_);
  for (int step = 0; step < 3; ++step) {
    Step(&network);
    ExpectReadsItsParameters(&network);
  }
  EXPECT_NE(network.Forward(x_), before);
  EXPECT_NE(network.ForwardTarget(x_), target_before);
}

TEST_P(TrainedNetworkTest, ProductsReadTheParametersThatWereSet) {
  Network network = Make(1);
  Step(&network);
  const VectorX<float> others = Make(2).parameters();
  network.SetParameters(others);
  EXPECT_EQ(network.parameters(), others);
  EXPECT_EQ(network.target(), others);
  ExpectReadsItsParameters(&network);
}

TEST_P(TrainedNetworkTest, ProductsReadTheParametersThatWereLoaded) {
  Network saved = Make(1), loaded = Make(2);
  for (int step = 0; step < 3; ++step) Step(&saved);
  TensorFile file;
  saved.Save("network", &file);
  ASSERT_TRUE(loaded.Load("network", file).ok());
  EXPECT_EQ(loaded.parameters(), saved.parameters());
  EXPECT_EQ(loaded.target(), saved.target());
  ExpectReadsItsParameters(&loaded);
  Step(&saved);
  Step(&loaded);
  EXPECT_EQ(loaded.parameters(), saved.parameters()) << "the moments or the number of steps were lost";
  EXPECT_EQ(loaded.target(), saved.target());
}

TEST_P(TrainedNetworkTest, ATargetThatAFileLacksStartsFromTheOnlineNetwork) {
  Network saved = Make(1), loaded = Make(2);
  for (int step = 0; step < 3; ++step) Step(&saved);
  TensorFile file;
  saved.Save("network", &file);
  ASSERT_TRUE(loaded.LoadOrStartTarget("network", file).ok());
  EXPECT_EQ(loaded.target(), saved.target()) << "it is there";

  ASSERT_EQ(file.tensors.erase("network.target"), 1u);
  EXPECT_TRUE(absl::IsDataLoss(loaded.Load("network", file)));
  ASSERT_TRUE(loaded.LoadOrStartTarget("network", file).ok());
  EXPECT_EQ(loaded.parameters(), saved.parameters());
  EXPECT_EQ(loaded.target(), saved.parameters());
  ExpectReadsItsParameters(&loaded);

  file.tensors.erase("network.adam.first");
  EXPECT_TRUE(absl::IsDataLoss(loaded.LoadOrStartTarget("network", file)));
}

INSTANTIATE_TEST_SUITE_P(Precisions, TrainedNetworkTest,
                         testing::Values(NetworkCase{false, {}}, NetworkCase{false, {33}},
                                         NetworkCase{false, {600, 70}}, NetworkCase{true, {}},
                                         NetworkCase{true, {33}}, NetworkCase{true, {600, 70}},
                                         NetworkCase{false, {600, 70}, true},
                                         NetworkCase{true, {600, 70}, true}),
                         [](const auto& info) {
                           return std::string(info.param.bfloat16 ? "Bfloat16" : "Float32") + "Depth" +
                                  std::to_string(info.param.hidden_sizes.size()) +
                                  (info.param.layer_norm ? "LayerNorm" : "");
                         });

}  // namespace
}  // namespace dbr
