// Tests the Polyak average of the policy: what it is, that it is exported, and that a checkpoint keeps it.
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "learner/algorithms/sac.h"
#include "nn/policy_networks.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

constexpr double kTau = 0.125;

AlgorithmSpec SpecOf(const AlgorithmId& id, std::uint64_t seed = 1) {
  AlgorithmSpec spec = SmallSpec(seed, id.actions);
  spec.config.clear_algorithm();
  AlgorithmConfig chosen;
  EXPECT_TRUE(google::protobuf::TextFormat::ParseFromString(absl::StrCat(id.name, " {}"), &chosen));
  spec.config.MergeFrom(chosen);
  spec.config.set_learning_rate(0.02);
  spec.config.set_target_tau(kTau);
  return spec;
}

template <class AnyAlgorithm>
PolicySnapshot PolicyOf(const AnyAlgorithm& algorithm) {
  PolicySnapshot snapshot;
  algorithm.ExportPolicy(&snapshot);
  return snapshot;
}

// The largest distance between the average in `snapshot` and `expected`.
double DistanceFromAverage(const PolicySnapshot& snapshot, const std::vector<double>& expected) {
  const std::vector<float>& average = *snapshot.Find(kPolicyAverage);
  EXPECT_EQ(average.size(), expected.size());
  double distance = 0;
  for (std::size_t i = 0; i < average.size(); ++i)
    distance = std::max(distance, std::abs(static_cast<double>(average[i]) - expected[i]));
  return distance;
}

TEST(PolicyAverage, OfSacIsThatOfAPlainLoop) {
  AlgorithmSpec spec = SmallSpec(1, ActionKind::kContinuous);
  spec.config.mutable_sac();
  spec.config.set_learning_rate(0.02);
  spec.config.set_target_tau(kTau);
  Sac<double> sac(spec);
  PolicySnapshot snapshot = PolicyOf(sac);
  const std::vector<float> first = *snapshot.Find(kPolicyNetwork);
  EXPECT_EQ(*snapshot.Find(kPolicyAverage), first) << "it starts at the policy";
  std::vector<double> average(first.begin(), first.end());
  Rng rng(3);
  for (int update = 0; update < 20; ++update) {
    const BasicBatch<double> batch = RandomBatch<double>(spec, 16, rng);
    ASSERT_TRUE(sac.Update(batch, batch, batch).ok());
    snapshot = PolicyOf(sac);
    const std::vector<float>& policy = *snapshot.Find(kPolicyNetwork);
    for (std::size_t i = 0; i < policy.size(); ++i) average[i] += kTau * (policy[i] - average[i]);
    ASSERT_LT(DistanceFromAverage(snapshot, average), 1e-6) << "update " << update;
  }
  const std::vector<float>& policy = *snapshot.Find(kPolicyNetwork);
  EXPECT_GT(DistanceFromAverage(snapshot, {policy.begin(), policy.end()}), 1e-3);
}

class PolicyAverageOf : public testing::TestWithParam<AlgorithmId> {
 protected:
  std::unique_ptr<Algorithm> Make(std::uint64_t seed) const {
    auto algorithm = MakeAlgorithm(SpecOf(GetParam(), seed));
    EXPECT_TRUE(algorithm.ok()) << algorithm.status();
    return std::move(algorithm).value();
  }
  void Update(Algorithm* algorithm, int updates) {
    for (int i = 0; i < updates; ++i) {
      const Batch batch = RandomBatch<float>(SpecOf(GetParam()), 16, rng_);
      ASSERT_TRUE(algorithm->Update({batch, batch, batch}).ok());
    }
  }
  static TensorFile StateOf(const Algorithm& algorithm) {
    TensorFile file;
    algorithm.Save(&file);
    return file;
  }

  Rng rng_{7};
};

// TD3 leaves out every second step of the policy, and its average then stays as well.
TEST_P(PolicyAverageOf, MovesWithEachStepOfThePolicy) {
  const auto algorithm = Make(1);
  PolicySnapshot before = PolicyOf(*algorithm);
  std::vector<double> average(before.Find(kPolicyAverage)->begin(), before.Find(kPolicyAverage)->end());
  for (int update = 0; update < 6; ++update) {
    Update(algorithm.get(), 1);
    PolicySnapshot after = PolicyOf(*algorithm);
    const std::vector<float>& policy = *after.Find(kPolicyNetwork);
    if (policy != *before.Find(kPolicyNetwork)) {
      for (std::size_t i = 0; i < policy.size(); ++i) average[i] += kTau * (policy[i] - average[i]);
    }
    ASSERT_LT(DistanceFromAverage(after, average), 1e-5) << "update " << update;
    before = std::move(after);
  }
  EXPECT_TRUE(PolicyNetworks::Create(before).ok());
}

TEST_P(PolicyAverageOf, GoesOnBitForBitAfterAResume) {
  const auto algorithm = Make(1), resumed = Make(2);
  Update(algorithm.get(), 3);
  ASSERT_TRUE(resumed->Load(StateOf(*algorithm)).ok());
  EXPECT_EQ(PolicyOf(*resumed).networks, PolicyOf(*algorithm).networks);
  rng_ = Rng(8);
  Update(algorithm.get(), 3);
  rng_ = Rng(8);
  Update(resumed.get(), 3);
  EXPECT_EQ(*PolicyOf(*resumed).Find(kPolicyAverage), *PolicyOf(*algorithm).Find(kPolicyAverage));
}

TEST_P(PolicyAverageOf, StartsFromThePolicyOfACheckpointThatHasNone) {
  const auto algorithm = Make(1), resumed = Make(2);
  Update(algorithm.get(), 3);
  TensorFile file = StateOf(*algorithm);
  ASSERT_EQ(file.tensors.erase("policy.target"), 1u);
  ASSERT_TRUE(resumed->Load(file).ok());
  const PolicySnapshot snapshot = PolicyOf(*resumed);
  EXPECT_EQ(*snapshot.Find(kPolicyNetwork), *PolicyOf(*algorithm).Find(kPolicyNetwork));
  EXPECT_EQ(*snapshot.Find(kPolicyAverage), *snapshot.Find(kPolicyNetwork));
}

TEST_P(PolicyAverageOf, NoOtherTensorMayBeMissing) {
  const TensorFile whole = StateOf(*Make(1));
  for (const auto& [name, values] : whole.tensors) {
    if (name == "policy.target") continue;
    TensorFile file = whole;
    file.tensors.erase(name);
    EXPECT_TRUE(absl::IsDataLoss(Make(1)->Load(file))) << name;
  }
  TensorFile other = whole;
  other.tensors["policy.target"].pop_back();
  EXPECT_TRUE(absl::IsInvalidArgument(Make(1)->Load(other)));
}

std::vector<AlgorithmId> ActorCritics() {
  std::vector<AlgorithmId> ids;
  for (const AlgorithmId& id : Algorithms()) {
    if (id.name != "ddqn") ids.push_back(id);
  }
  return ids;
}

INSTANTIATE_TEST_SUITE_P(Registry, PolicyAverageOf, testing::ValuesIn(ActorCritics()), [](const auto& info) {
  return absl::StrCat(info.param.name,
                      info.param.actions == ActionKind::kDiscrete ? "Discrete" : "Continuous");
});

TEST(PolicyAverage, DdqnHasNone) {
  for (const AlgorithmId& id : Algorithms()) {
    if (id.name != "ddqn") continue;
    EXPECT_EQ(PolicyOf(**MakeAlgorithm(SpecOf(id))).Find(kPolicyAverage), nullptr);
  }
}

}  // namespace
}  // namespace dbr
