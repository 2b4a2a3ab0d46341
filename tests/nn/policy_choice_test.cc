// Tests the choice between a policy and its average.
#include "nn/policy_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace dbr {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;
using Floats = std::vector<float>;

const Floats kRaw = {0, 0, 1, 0}, kAverage = {0, 0, 0, 1}, kCritic = {0, 0, 5, 6};

// Two actions, one observation, no hidden layer.
PolicySnapshot Both() {
  PolicySnapshot snapshot;
  snapshot.version = 7;
  snapshot.updates = 70;
  snapshot.support_epsilon = 0.25f;
  snapshot.spec = {.env = "test",
                   .algorithm = "dbr",
                   .observation_size = 1,
                   .actions = {ActionKind::kDiscrete, 2},
                   .hidden_sizes = {}};
  snapshot.networks = {{kPolicyNetwork, kRaw}, {kPolicyAverage, kAverage}, {kCritic1, kCritic}};
  return snapshot;
}

TEST(PolicyChoiceTest, TheChosenNetworkActsAndTheOtherGoes) {
  const auto both = PolicyNetworks::Create(Both()).value();
  EXPECT_THAT(WithActing(both, RAW)->snapshot().networks,
              ElementsAre(Pair(kPolicyNetwork, kRaw), Pair(kCritic1, kCritic)));
  const auto average = WithActing(both, AVERAGE);
  EXPECT_THAT(average->snapshot().networks,
              ElementsAre(Pair(kPolicyNetwork, kAverage), Pair(kCritic1, kCritic)));
  EXPECT_EQ(average->snapshot().version, 7u);
  EXPECT_EQ(average->snapshot().updates, 70u);
  EXPECT_EQ(average->snapshot().support_epsilon, 0.25f);
  EXPECT_EQ(average->spec(), both->spec());
}

TEST(PolicyChoiceTest, WithoutAnAverageTheRawPolicyActs) {
  PolicySnapshot raw = Both();
  raw.networks.erase(raw.networks.begin() + 1);
  const auto policy = PolicyNetworks::Create(raw).value();
  for (const PolicyChoice choice : {RAW, AVERAGE}) {
    EXPECT_EQ(WithActing(policy, choice), policy) << "it needs no copy";
    EXPECT_EQ(ServedChoice(raw, choice), RAW);
    EXPECT_EQ(ServedChoice(Both(), choice), choice);
  }
}

TEST(PolicyChoiceTest, AnAverageOfAnotherSizeIsRefused) {
  PolicySnapshot snapshot = Both();
  snapshot.networks[1].second.pop_back();
  EXPECT_THAT(std::string(PolicyNetworks::Create(snapshot).status().message()),
              HasSubstr("network 'policy_average': expected 4 parameters for its sizes, found 3"));
}

}  // namespace
}  // namespace dbr
