#include "actor/vector_env.h"

#include <vector>

#include "core/rng.h"
#include "envs/registry/registry.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/actor/line_env.h"

namespace dbr {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

int AnyLegal(absl::Span<const float> mask, Rng& rng) {
  std::vector<int> legal;
  for (int k = 0; k < static_cast<int>(mask.size()); ++k) {
    if (mask[k] > 0) legal.push_back(k);
  }
  return legal[rng.Below(legal.size())];
}

TEST(VectorEnvTest, StepsEachEnvironmentAsItWouldStepAlone) {
  constexpr int kCount = 5;
  const EnvOptions options = {.name = "connect4", .opponents = {"one_ply"}};
  const auto envs = VectorEnv::Create(options, kCount).value();
  for (int i = 0; i < kCount; ++i) envs->Reset(i, 100 + i);
  std::vector<std::vector<float>> moves(kCount);
  std::vector<std::vector<float>> seen(kCount);
  std::vector<bool> done(kCount, false);
  std::vector<StepResult> last(kCount);
  Rng rng(1);
  MatrixX<float> actions(1, kCount);
  for (int step = 0; step < 21; ++step) {
    for (int i = 0; i < kCount; ++i) {
      if (done[i]) continue;
      actions(0, i) = static_cast<float>(AnyLegal(Column(envs->masks(), i), rng));
      moves[i].push_back(actions(0, i));
      last[i] = envs->Step(i, actions);
      done[i] = last[i].done();
      const auto next = Column(envs->next_observations(), i);
      seen[i].insert(seen[i].end(), next.begin(), next.end());
    }
    envs->Advance();
  }
  for (int i = 0; i < kCount; ++i) {
    ASSERT_TRUE(done[i]);
    const auto env = MakeEnv(options).value();
    std::vector<float> observation(env->spec().observation_size), mask(env->spec().actions.mask_width()),
        alone;
    env->Reset(100 + i, absl::MakeSpan(observation), absl::MakeSpan(mask));
    StepResult result;
    for (const float move : moves[i]) {
      ASSERT_FALSE(result.done());
      result = env->Step({&move, 1}, absl::MakeSpan(observation), absl::MakeSpan(mask));
      alone.insert(alone.end(), observation.begin(), observation.end());
    }
    EXPECT_THAT(seen[i], ElementsAreArray(alone));
    EXPECT_TRUE(result.done());
    EXPECT_EQ(result.reward, last[i].reward);
    EXPECT_EQ(result.score, last[i].score);
  }
}

TEST(VectorEnvTest, KeepsBothSidesOfAStepUntilAdvance) {
  const auto envs = MakeLines(2);
  envs->Reset(0, 6);
  envs->Reset(1, 7);
  MatrixX<float> actions = MatrixX<float>::Constant(1, 2, 1);
  envs->Step(0, actions);
  envs->Step(1, actions);
  EXPECT_THAT(Column(envs->observations(), 1), ElementsAreArray({7.0f, 0.0f}));
  EXPECT_THAT(Column(envs->masks(), 1), ElementsAreArray({0.0f, 1.0f, 1.0f}));
  EXPECT_THAT(Column(envs->next_observations(), 1), ElementsAreArray({7.0f, 1.0f}));
  EXPECT_THAT(Column(envs->next_masks(), 1), ElementsAreArray({1.0f, 0.0f, 1.0f}));
  envs->Advance();
  EXPECT_THAT(Column(envs->observations(), 0), ElementsAreArray({6.0f, 1.0f}));
  EXPECT_THAT(Column(envs->masks(), 0), ElementsAreArray({1.0f, 0.0f, 1.0f}));
}

TEST(VectorEnvTest, RestartsOneEnvironmentAndLeavesTheOthers) {
  const auto envs = MakeLines(2);
  envs->Reset(0, 6);
  envs->Reset(1, 7);
  MatrixX<float> actions = MatrixX<float>::Constant(1, 2, 1);
  for (int i = 0; i < 2; ++i) envs->Step(i, actions);
  envs->Advance();
  envs->Reset(0, 8);
  EXPECT_THAT(Column(envs->observations(), 0), ElementsAreArray({8.0f, 0.0f}));
  EXPECT_THAT(Column(envs->observations(), 1), ElementsAreArray({7.0f, 1.0f}));
}

TEST(VectorEnvTest, PassesOnThatAnEnvironmentIsUnknown) {
  const absl::Status status = VectorEnv::Create({.name = "connect5", .opponents = {}}, 2).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("connect5"));
}

}  // namespace
}  // namespace dbr
