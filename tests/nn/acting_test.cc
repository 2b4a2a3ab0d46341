// Tests acting by a policy: each way of choosing, masks, and values that are not finite.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/mlp.h"
#include "nn/policy.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

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

// What acting and its labels see must be the critics that were trained, normalised or not.
TEST(ActingByCritics, TheirHiddenLayersAreNormalisedWhereTheyWereInTraining) {
  for (const bool layer_norm : {false, true}) {
    PolicySnapshot snapshot;
    snapshot.spec = {.env = "test",
                     .algorithm = "dbr",
                     .observation_size = 5,
                     .actions = {ActionKind::kDiscrete, 4},
                     .hidden_sizes = {8, 6},
                     .critic_layer_norm = layer_norm};
    Rng rng(3);
    const MlpShape critic(5, {8, 6}, 4, layer_norm);
    VectorX<float> twins[2];
    const VectorX<float> pi = InitialParameters<float>(MlpShape(5, {8, 6}, 4), rng);
    snapshot.networks.emplace_back(kPolicyNetwork, std::vector<float>(pi.begin(), pi.end()));
    for (int i = 0; i < 2; ++i) {
      twins[i] = InitialParameters<float>(critic, rng);
      snapshot.networks.emplace_back(i == 0 ? kCritic1 : kCritic2,
                                     std::vector<float>(twins[i].begin(), twins[i].end()));
    }
    const auto policy = PolicyNetworks::Create(snapshot);
    ASSERT_TRUE(policy.ok()) << policy.status();
    MatrixX<float> x(5, 3);
    for (float& entry : x.reshaped()) entry = static_cast<float>(rng.Normal());
    MlpActivations<float> first, second;
    const MatrixX<float> expected = MlpForward<float>(critic, twins[0].data(), x, &first)
                                        .cwiseMin(MlpForward<float>(critic, twins[1].data(), x, &second));
    PolicyRunner runner;
    const MatrixX<float> q = runner.View(**policy, x, MatrixX<float>::Ones(4, 3)).q;
    EXPECT_LT((q - expected).cwiseAbs().maxCoeff(), 1e-5f) << "layer norm " << layer_norm;
  }
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
