#include "actor/policy_fit.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

EnvSpec Hopper() {
  return {.name = "hopper", .observation_size = 15, .actions = {ActionKind::kContinuous, 3}};
}

PolicySpec HopperPolicy() {
  return {.env = "hopper",
          .algorithm = "sac",
          .observation_size = 15,
          .actions = {ActionKind::kContinuous, 3},
          .hidden_sizes = {64, 64}};
}

TEST(PolicyFitTest, AnyAlgorithmAndAnySizesFit) {
  EXPECT_TRUE(CheckPolicyFits(HopperPolicy(), Hopper()).ok());
}

TEST(PolicyFitTest, NamesEveryFieldThatDoesNotFit) {
  PolicySpec policy = HopperPolicy();
  policy.env = "ant";
  policy.observation_size = 28;
  policy.actions = {ActionKind::kDiscrete, 3};
  const absl::Status status = CheckPolicyFits(policy, Hopper());
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("env: expected hopper, found ant"),
                    HasSubstr("observation_size: expected 15, found 28"),
                    HasSubstr("actions: expected 3 dimensions, found 3 choices"), Not(HasSubstr("sizes:"))));
}

}  // namespace
}  // namespace dbr
