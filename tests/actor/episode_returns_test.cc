#include "actor/episode_returns.h"

#include <cmath>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr {
namespace {

constexpr TransitionLayout kLayout{.observation_width = 1, .action_width = 1, .return_width = 1};

struct Out {
  float observation, reward, monte_carlo_return, advantage;
  std::uint64_t critic_version;
  std::optional<EpisodeEnd> end;
};

class EpisodeReturnsTest : public ::testing::Test {
 protected:
  EpisodeReturns Make(const ReturnOptions& options) {
    return EpisodeReturns(
        kLayout, /*envs=*/2, options,
        [this](const TransitionView& t, float advantage, std::uint64_t version,
               const std::optional<EpisodeEnd>& end) {
          out_.push_back({t.observation[0], t.reward, t.monte_carlo_return, advantage, version, end});
          return sink_status_;
        });
  }

  // Adds a step with the observation 10 * env + reward.
  static absl::Status Add(EpisodeReturns* returns, int env, float reward, float discount,
                          const TransitionValue& value, bool ends) {
    const float observation[1] = {static_cast<float>(10 * env) + reward}, action[1] = {0};
    return returns->Add(
        env,
        {.observation = observation,
         .action = action,
         .reward = reward,
         .discount = discount,
         .next_observation = observation},
        value, ends ? std::optional<EpisodeEnd>(EpisodeEnd{.episode_return = 1, .length = 3}) : std::nullopt);
  }

  std::vector<Out> out_;
  absl::Status sink_status_;
};

TEST_F(EpisodeReturnsTest, HoldsAnEpisodeBackUntilItEnds) {
  EpisodeReturns returns = Make({.discount = 0.5});
  ASSERT_TRUE(Add(&returns, 0, 1, 0.5f, {.value = 2, .critic_version = 7}, false).ok());
  ASSERT_TRUE(Add(&returns, 1, 5, 0.5f, {.value = 3, .critic_version = 7}, false).ok());
  ASSERT_TRUE(Add(&returns, 0, 2, 0.5f, {.value = 1, .critic_version = 8}, false).ok());
  EXPECT_TRUE(out_.empty());
  EXPECT_EQ(returns.held(), 3u);
  ASSERT_TRUE(Add(&returns, 0, 4, 0, {.value = NAN, .next_value = 100, .critic_version = 8}, true).ok());
  EXPECT_EQ(returns.held(), 1u);
  ASSERT_EQ(out_.size(), 3u);
  const float expected[3] = {3, 4, 4};  // 1 + 0.5 * 4, 2 + 0.5 * 4, 4
  for (int t = 0; t < 3; ++t) {
    EXPECT_EQ(out_[t].observation, out_[t].reward);
    EXPECT_EQ(out_[t].monte_carlo_return, expected[t]);
    EXPECT_EQ(out_[t].end.has_value(), t == 2);
  }
  EXPECT_EQ(out_[0].advantage, 3 - 2);
  EXPECT_EQ(out_[1].advantage, 4 - 1);
  EXPECT_TRUE(std::isnan(out_[2].advantage)) << "without a critic it is not yet judged";
  EXPECT_EQ(out_[0].critic_version, 7u);
  EXPECT_EQ(out_[1].critic_version, 8u);
  EXPECT_EQ(out_[2].end->length, 3);
}

TEST_F(EpisodeReturnsTest, TheNextEpisodeStartsFromNothing) {
  EpisodeReturns returns = Make({.discount = 0.5});
  for (int episode = 0; episode < 2; ++episode) {
    ASSERT_TRUE(Add(&returns, 0, 1, 0.5f, {}, false).ok());
    ASSERT_TRUE(Add(&returns, 0, 2, 0, {}, true).ok());
  }
  ASSERT_EQ(out_.size(), 4u);
  EXPECT_EQ(out_[2].monte_carlo_return, 2);
  EXPECT_EQ(out_[3].monte_carlo_return, 2);
}

TEST_F(EpisodeReturnsTest, ACutEpisodeGoesOnWithTheCriticsValueInTheEnvironmentsUnits) {
  EpisodeReturns returns = Make({.reward_scale = 10, .discount = 0.5});
  ASSERT_TRUE(Add(&returns, 1, 1, 0.5f, {.value = 30}, false).ok());
  ASSERT_TRUE(Add(&returns, 1, 2, 0.5f, {.value = 50, .next_value = 80}, true).ok());
  ASSERT_EQ(out_.size(), 2u);
  EXPECT_FLOAT_EQ(out_[1].monte_carlo_return, 2 + 0.5f * 8);
  EXPECT_FLOAT_EQ(out_[0].monte_carlo_return, 1 + 0.5f * 6);
  EXPECT_FLOAT_EQ(out_[1].advantage, 60 - 50);
  EXPECT_FLOAT_EQ(out_[0].advantage, 40 - 30);
}

TEST_F(EpisodeReturnsTest, WithoutACriticACutEpisodeGoesOnAsItEnded) {
  EpisodeReturns returns = Make({.discount = 0.5});
  ASSERT_TRUE(Add(&returns, 0, 9, 0.5f, {.value = NAN}, false).ok());
  ASSERT_TRUE(Add(&returns, 0, 1, 0.5f, {.value = NAN}, false).ok());
  ASSERT_TRUE(Add(&returns, 0, 3, 0.5f, {.value = NAN, .next_value = NAN}, true).ok());
  EXPECT_FLOAT_EQ(out_[2].monte_carlo_return, 3 + 0.5f * (1 + 3) / 2 / 0.5f);
}

TEST_F(EpisodeReturnsTest, GivesTheSinksFirstError) {
  EpisodeReturns returns = Make({.discount = 0.5});
  ASSERT_TRUE(Add(&returns, 0, 1, 0.5f, {}, false).ok());
  sink_status_ = absl::CancelledError("closed");
  EXPECT_TRUE(absl::IsCancelled(Add(&returns, 0, 2, 0, {}, true)));
  EXPECT_EQ(out_.size(), 1u);
  EXPECT_EQ(returns.held(), 0u);
}

}  // namespace
}  // namespace dbr
