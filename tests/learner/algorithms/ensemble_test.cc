// Tests algorithms with more critics than two, or with one: what is trained, what is asked, and what a
// checkpoint of other fields lacks.
#include <gmock/gmock.h>
#include <google/protobuf/message.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "learner/algorithms/registry.h"
#include "learner/training/tensor_state.h"
#include "nn/policy_networks.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

// The algorithms with an ensemble of critics. Double DQN has one network alone.
std::vector<AlgorithmId> WithCritics() {
  std::vector<AlgorithmId> chosen;
  for (const AlgorithmId& id : Algorithms()) {
    if (id.name != "ddqn") chosen.push_back(id);
  }
  return chosen;
}

class Ensemble : public testing::TestWithParam<AlgorithmId> {
 protected:
  Ensemble() : spec_(SmallSpec(1, GetParam().actions)) {
    const google::protobuf::FieldDescriptor* field =
        AlgorithmConfig::descriptor()->FindFieldByName(GetParam().name);
    spec_.config.GetReflection()->MutableMessage(&spec_.config, field);
    if (spec_.config.has_bear()) spec_.config.mutable_bear()->add_vae_hidden_sizes(8);
  }

  std::unique_ptr<Algorithm> Make() const {
    auto algorithm = MakeAlgorithm(spec_);
    EXPECT_TRUE(algorithm.ok()) << algorithm.status();
    return *std::move(algorithm);
  }
  void SetCritics(int critics, int asked = 2) {
    spec_.config.set_critics(static_cast<std::uint32_t>(critics));
    spec_.config.set_target_critics(static_cast<std::uint32_t>(asked));
  }
  static TensorFile StateOf(const Algorithm& algorithm) {
    TensorFile file;
    algorithm.Save(&file);
    return file;
  }
  void Update(Algorithm* algorithm) {
    const Batch uniform = RandomBatch<float>(spec_, 16, rng_), other = RandomBatch<float>(spec_, 16, rng_);
    ASSERT_TRUE(algorithm->Update({uniform, other, other}).ok());
  }

  AlgorithmSpec spec_;
  Rng rng_{9};
};

TEST_P(Ensemble, EveryUpdateTrainsEveryCritic) {
  SetCritics(4);
  const std::set<std::string> delayed = {"td3", "td3_bc", "rebrac"};
  const auto algorithm = Make();
  for (int i = 0; i < 5; ++i) {
    const TensorFile before = StateOf(*algorithm);
    Update(algorithm.get());
    const TensorFile after = StateOf(*algorithm);
    for (int critic = 1; critic <= 4; ++critic) {
      const std::string name = absl::StrCat("critic_", critic);
      EXPECT_NE(after.tensors.at(name), before.tensors.at(name)) << name << " in update " << i;
      if (delayed.contains(GetParam().name) && i % 2 == 1) continue;  // targets move with the policy
      EXPECT_NE(after.tensors.at(name + ".target"), before.tensors.at(name + ".target")) << name;
    }
  }
}

// Critic i is worth 10 i everywhere, target and online alike, so that DBR's mean target tells which critics
// were asked: 7.5 times the smaller and 2.5 times the greater number.
TEST_P(Ensemble, EachUpdateAsksAPairAndEachPairHasItsTurn) {
  if (GetParam().name != "dbr") GTEST_SKIP() << "the target tells the smaller one alone";
  SetCritics(4);
  const auto algorithm = Make();
  TensorFile state = StateOf(*algorithm);
  for (int critic = 1; critic <= 4; ++critic) {
    const std::string name = absl::StrCat("critic_", critic);
    for (const std::string& network : {name, name + ".target"}) {
      std::vector<float>& values = state.tensors.at(network);
      std::fill(values.begin(), values.end(), 0.0f);
      const std::ptrdiff_t outputs = spec_.actions.discrete() ? 3 : 1;
      std::fill(values.end() - outputs, values.end(), 10.0f * static_cast<float>(critic));
    }
  }
  Batch batch = RandomBatch<float>(spec_, 16, rng_);
  batch.rewards.setZero();
  batch.discounts.setOnes();
  std::set<int> targets;
  for (int i = 0; i < 60; ++i) {
    // Each update begins from the same networks, with its own random numbers.
    PutRng("dbr.rng", Rng(100 + static_cast<std::uint64_t>(i)), &state);
    ASSERT_TRUE(algorithm->Load(state).ok());
    ASSERT_TRUE(algorithm->Update({batch, batch, batch}).ok());
    for (const UpdateMetric& metric : algorithm->metrics()) {
      if (std::string(metric.name) == "train/target_mean") {
        targets.insert(static_cast<int>(std::lround(metric.value * 10)));
      }
    }
  }
  std::set<int> pairs;
  for (const auto& [low, high] : {std::pair{1, 2}, {1, 3}, {1, 4}, {2, 3}, {2, 4}, {3, 4}}) {
    pairs.insert(75 * low + 25 * high);
  }
  EXPECT_EQ(targets, pairs);
}

TEST_P(Ensemble, ACheckpointOfTwoCriticsLacksTheThirdOfFour) {
  SetCritics(2);
  const TensorFile two = StateOf(*Make());
  SetCritics(4);
  const absl::Status status = Make()->Load(two);
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("critic_3"));
}

TEST_P(Ensemble, OneCriticIsEnough) {
  SetCritics(1, 1);
  const auto algorithm = Make();
  for (int i = 0; i < 3; ++i) Update(algorithm.get());
  EXPECT_EQ(StateOf(*algorithm).tensors.count("critic_2"), 0u);
  PolicySnapshot snapshot;
  algorithm->ExportPolicy(&snapshot);
  EXPECT_EQ(*snapshot.Find(kCritic1), *snapshot.Find(kCritic2)) << "actors get it twice";
  EXPECT_TRUE(PolicyNetworks::Create(snapshot).ok());
}

// The counts of the defaults, written out or not, are the two critics of the papers, and draw nothing.
TEST_P(Ensemble, TwoOfTwoAreTheDefault) {
  const auto plain = Make();
  SetCritics(2);
  const auto two = Make();
  for (int i = 0; i < 3; ++i) {
    Rng here = rng_;
    Update(plain.get());
    rng_ = here;
    Update(two.get());
  }
  EXPECT_EQ(StateOf(*plain).tensors, StateOf(*two).tensors);
  EXPECT_EQ(StateOf(*plain).metadata, StateOf(*two).metadata);
}

TEST_P(Ensemble, MoreCriticsThanAskedAreServedOnTwoThreadsAsOnOne) {
  SetCritics(3, 1);
  TensorFile states[2];
  for (const std::uint32_t threads : {1, 2}) {
    spec_.config.set_threads(threads);
    const auto algorithm = Make();
    rng_ = Rng(4);
    for (int i = 0; i < 10; ++i) Update(algorithm.get());
    states[threads - 1] = StateOf(*algorithm);
  }
  EXPECT_EQ(states[0].tensors, states[1].tensors);
}

INSTANTIATE_TEST_SUITE_P(Registry, Ensemble, testing::ValuesIn(WithCritics()), [](const auto& info) {
  return info.param.name + (info.param.actions == ActionKind::kDiscrete ? "Discrete" : "Continuous");
});

}  // namespace
}  // namespace dbr
