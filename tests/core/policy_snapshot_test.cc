#include "core/policy_snapshot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dbr {
namespace {

using testing::HasSubstr;
using testing::Not;

PolicySpec Spec() {
  return {.env = "connect4",
          .algorithm = "dbr",
          .observation_size = 84,
          .actions = {ActionKind::kDiscrete, 7},
          .hidden_sizes = {256, 256}};
}

TEST(CheckSameSpecTest, AcceptsTheSame) {
  EXPECT_TRUE(CheckSameSpec(Spec(), Spec()).ok());
}

TEST(CheckSameSpecTest, NamesEveryFieldThatDiffers) {
  PolicySpec other = Spec();
  other.env = "hopper";
  other.observation_size = 15;
  other.actions = {ActionKind::kContinuous, 3};
  other.hidden_sizes = {64};
  other.critic_layer_norm = true;
  other.algorithm = "sac";
  const absl::Status status = CheckSameSpec(Spec(), other);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  const std::string message(status.message());
  EXPECT_THAT(message, HasSubstr("env: expected connect4, found hopper"));
  EXPECT_THAT(message, HasSubstr("observation_size: expected 84, found 15"));
  EXPECT_THAT(message, HasSubstr("actions: expected 7 choices, found 3 dimensions"));
  EXPECT_THAT(message, HasSubstr("hidden_sizes: expected 256-256, found 64"));
  EXPECT_THAT(message, HasSubstr("critic_layer_norm: expected false, found true"));
  EXPECT_THAT(message, HasSubstr("algorithm: expected dbr, found sac"));
}

TEST(CheckSameSpecTest, NamesOnlyWhatDiffers) {
  PolicySpec other = Spec();
  other.hidden_sizes = {256, 128};
  const std::string message(CheckSameSpec(Spec(), other).message());
  EXPECT_THAT(message, HasSubstr("hidden_sizes: expected 256-256, found 256-128"));
  EXPECT_THAT(message, Not(HasSubstr("env:")));
}

TEST(CheckSameSpecTest, AnEmptyAlgorithmExpectsAny) {
  PolicySpec expected = Spec();
  expected.algorithm.clear();
  EXPECT_TRUE(CheckSameSpec(expected, Spec()).ok());
  EXPECT_FALSE(CheckSameSpec(Spec(), expected).ok());
}

TEST(PolicySnapshotTest, ChecksumSeesEveryParameter) {
  PolicySnapshot snapshot;
  snapshot.networks = {{kPolicyNetwork, {1, 2, 3}}, {kCritic1, {4, 5}}};
  const std::uint32_t before = Checksum(snapshot);
  for (auto& [name, parameters] : snapshot.networks) {
    for (float& parameter : parameters) {
      parameter += 1;
      EXPECT_NE(Checksum(snapshot), before) << name;
      parameter -= 1;
    }
  }
  EXPECT_EQ(Checksum(snapshot), before);
}

TEST(PolicySnapshotTest, FindsNetworksByName) {
  PolicySnapshot snapshot;
  snapshot.networks = {{kPolicyNetwork, {1}}, {kCritic1, {2}}};
  ASSERT_NE(snapshot.Find(kCritic1), nullptr);
  EXPECT_EQ(snapshot.Find(kCritic1)->front(), 2);
  EXPECT_EQ(snapshot.Find(kBetaPlus), nullptr);
}

}  // namespace
}  // namespace dbr
