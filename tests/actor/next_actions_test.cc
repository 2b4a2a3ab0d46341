#include "actor/next_actions.h"

#include <gtest/gtest.h>

#include <vector>

#include "actor/step_loop.h"
#include "tests/actor/line_env.h"
#include "tests/actor/test_policies.h"

namespace dbr {
namespace {

constexpr TransitionLayout kLayout{.observation_width = 1, .action_width = 1, .next_action_width = 1};

struct Out {
  int env;
  float observation, action, next_action, advantage;
  bool ends;
};

class NextActionsTest : public ::testing::Test {
 protected:
  // Adds a step with `action` both as action and as observation.
  absl::Status Add(int env, float action, float discount = 0.9f, bool ends = false, float cut_action = 0) {
    return next_actions_.Add(env,
                             {.observation = {&action, 1},
                              .action = {&action, 1},
                              .discount = discount,
                              .next_observation = {&action, 1}},
                             {.advantage = 2 * action, .critic_version = 3},
                             ends ? std::optional<EpisodeEnd>(EpisodeEnd{.length = 1}) : std::nullopt,
                             {&cut_action, 1});
  }

  std::vector<Out> out_;
  absl::Status sink_status_;
  NextActions next_actions_{kLayout, /*envs=*/2,
                            [this](int env, const TransitionView& t, const FirstJudgement& judgement,
                                   const std::optional<EpisodeEnd>& end) {
                              EXPECT_EQ(judgement.critic_version, 3u);
                              out_.push_back({env, t.observation[0], t.action[0], t.next_action[0],
                                              judgement.advantage, end.has_value()});
                              return sink_status_;
                            }};
};

TEST_F(NextActionsTest, EachTransitionWaitsForTheNextActionOfItsOwnEnvironment) {
  ASSERT_TRUE(Add(0, 0.1f).ok());
  ASSERT_TRUE(Add(1, 0.5f).ok());
  EXPECT_TRUE(out_.empty());
  EXPECT_EQ(next_actions_.held(), 2u);
  ASSERT_TRUE(Add(0, 0.2f).ok());
  ASSERT_EQ(out_.size(), 1u);
  EXPECT_EQ(out_[0].env, 0);
  EXPECT_EQ(out_[0].observation, 0.1f);
  EXPECT_EQ(out_[0].action, 0.1f);
  EXPECT_EQ(out_[0].next_action, 0.2f);
  EXPECT_EQ(out_[0].advantage, 0.2f) << "its own, not the next one's";
  EXPECT_FALSE(out_[0].ends);
  EXPECT_EQ(next_actions_.held(), 2u);
}

TEST_F(NextActionsTest, ATerminalHasZerosAndACutWhatWouldFollow) {
  ASSERT_TRUE(Add(0, 0.1f).ok());
  ASSERT_TRUE(Add(0, 0.2f, /*discount=*/0, /*ends=*/true, /*cut_action=*/0.7f).ok());
  ASSERT_TRUE(Add(1, 0.3f, 0.9f, /*ends=*/true, /*cut_action=*/0.7f).ok());
  ASSERT_EQ(out_.size(), 3u);
  EXPECT_EQ(out_[0].next_action, 0.2f);
  EXPECT_EQ(out_[1].next_action, 0);
  EXPECT_TRUE(out_[1].ends);
  EXPECT_EQ(out_[2].next_action, 0.7f);
  EXPECT_EQ(next_actions_.held(), 0u);
  // The next episode does not follow the last one.
  ASSERT_TRUE(Add(0, 0.4f).ok());
  EXPECT_EQ(out_.size(), 3u);
}

TEST_F(NextActionsTest, GivesTheSinksError) {
  sink_status_ = absl::UnavailableError("gone");
  ASSERT_TRUE(Add(0, 0.1f).ok());
  EXPECT_TRUE(absl::IsUnavailable(Add(0, 0.2f)));
}

// Through the whole loop, over ends and cuts and for transitions of several steps: the next action is the
// action at the next state.
TEST(StepLoopNextActions, AreTheActionsAtTheNextStates) {
  struct Seen {
    float seed, step, action, discount, next_step, next_action;
    bool ends;
  };
  for (const int n : {1, 3}) {
    SCOPED_TRACE(n);
    std::vector<Seen> seen;
    StepLoop loop(MakeLines(4), {.discount = 0.8, .columns = {.next_actions = true}, .n_step = n}, Rng(1),
                  [&](const TransitionView& t, float, std::uint64_t, const std::optional<EpisodeEnd>& end) {
                    seen.push_back({t.observation[0], t.observation[1], t.action[0], t.discount,
                                    t.next_observation[1], t.next_action[0], end.has_value()});
                    return absl::OkStatus();
                  });
    const auto policy = UntrainedPolicy(LineEnv().spec(), 5, /*with_critics=*/true);
    for (int step = 0; step < 60; ++step) ASSERT_TRUE(loop.Step(*policy).ok());
    EXPECT_EQ(loop.counters().transitions, seen.size() + loop.held_back());
    int followed = 0, terminals = 0;
    for (const Seen& transition : seen) {
      if (transition.discount == 0) {
        EXPECT_EQ(transition.next_action, 0);
        ++terminals;
      }
      for (const Seen& later : seen) {
        if (later.seed != transition.seed || later.step != transition.next_step) continue;
        EXPECT_EQ(transition.next_action, later.action);
        ++followed;
      }
    }
    EXPECT_GT(followed, 20);
    EXPECT_GT(terminals, 3);
  }
}

}  // namespace
}  // namespace dbr
