#include "actor/step_loop.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/actor/line_env.h"
#include "tests/actor/plain_n_step.h"
#include "tests/actor/test_policies.h"

namespace dbr {
namespace {

using Floats = std::vector<float>;

constexpr int kEnvs = 6;
constexpr int kSteps = 40;

// A transition as the sink received it.
struct Seen {
  Floats observation, action, mask, next_observation, next_mask;
  float reward, discount, monte_carlo_return, advantage;
  std::uint64_t critic_version;
  std::optional<EpisodeEnd> end;

  float seed() const { return observation[0]; }
  float step() const { return observation[1]; }
};

Floats Copy(absl::Span<const float> span) {
  return {span.begin(), span.end()};
}

TransitionSink Into(std::vector<Seen>* seen) {
  return [seen](const TransitionView& t, float advantage, std::uint64_t version,
                const std::optional<EpisodeEnd>& end) {
    seen->push_back({Copy(t.observation), Copy(t.action), Copy(t.mask), Copy(t.next_observation),
                     Copy(t.next_mask), t.reward, t.discount, t.monte_carlo_return, advantage, version, end});
    return absl::OkStatus();
  };
}

// Makes kSteps steps in kEnvs lines by one policy. Entry [step * kEnvs + i] belongs to environment i.
std::vector<Seen> Walk(const StepLoopOptions& options, std::uint64_t seed, bool with_critics = true) {
  std::vector<Seen> seen;
  StepLoop loop(MakeLines(kEnvs), options, Rng(seed), Into(&seen));
  const auto policy = UntrainedPolicy(LineEnv().spec(), 5, with_critics);
  for (int step = 0; step < kSteps; ++step) EXPECT_TRUE(loop.Step(*policy).ok());
  EXPECT_EQ(loop.counters().transitions, seen.size());
  return seen;
}

TEST(StepLoopTest, BootstrapsWhereAnEpisodeIsCutAndNotWhereItTerminates) {
  int terminated = 0, cut = 0;
  for (const Seen& t : Walk({.discount = 0.9}, 1)) {
    const auto seed = static_cast<std::uint64_t>(t.seed());
    // seed % 1000 keeps seed % 2 and seed % 4.
    const bool last = t.step() + 1 == static_cast<float>(LineEnv::LengthOf(seed));
    ASSERT_EQ(t.end.has_value(), last);
    const bool terminal = last && !LineEnv::IsCut(seed);
    EXPECT_EQ(t.discount, terminal ? 0.0f : 0.9f);
    terminated += terminal;
    cut += last && !terminal;
  }
  EXPECT_GT(terminated, 5);
  EXPECT_GT(cut, 5);
}

TEST(StepLoopTest, CountsTheEpisodesWhoseWorldBroke) {
  std::vector<Seen> seen;
  StepLoop loop(MakeLines(kEnvs), {}, Rng(4), Into(&seen));
  const auto policy = UntrainedPolicy(LineEnv().spec(), 5, /*with_critics=*/true);
  for (int step = 0; step < kSteps; ++step) ASSERT_TRUE(loop.Step(*policy).ok());
  std::uint64_t broken = 0;
  for (const Seen& t : seen) {
    broken += t.end.has_value() && LineEnv::Breaks(static_cast<std::uint64_t>(t.seed()));
  }
  EXPECT_GT(broken, 0);
  EXPECT_EQ(loop.counters().broken, broken);
}

TEST(StepLoopTest, NextObservationIsTheFollowingObservation) {
  const std::vector<Seen> seen = Walk({}, 2);
  for (std::size_t i = 0; i + kEnvs < seen.size(); ++i) {
    const Seen& now = seen[i];
    const Seen& following = seen[i + kEnvs];
    EXPECT_EQ(now.next_observation, (Floats{now.seed(), now.step() + 1}));
    if (now.end.has_value()) {
      EXPECT_EQ(following.step(), 0);
    } else {
      EXPECT_EQ(now.next_observation, following.observation);
      EXPECT_EQ(now.next_mask, following.mask);
    }
  }
}

TEST(StepLoopTest, TellsHowEachEpisodeWent) {
  const std::vector<Seen> seen = Walk({}, 3);
  std::vector<double> returns(kEnvs, 0.0);
  std::vector<int> lengths(kEnvs, 0);
  int ends = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    double& episode_return = returns[i % kEnvs];
    int& length = lengths[i % kEnvs];
    episode_return += seen[i].reward;
    ++length;
    if (!seen[i].end.has_value()) continue;
    ++ends;
    EXPECT_FLOAT_EQ(seen[i].end->episode_return, static_cast<float>(episode_return));
    EXPECT_EQ(seen[i].end->length, length);
    EXPECT_TRUE(std::isnan(seen[i].end->score));
    episode_return = 0;
    length = 0;
  }
  EXPECT_GT(ends, 10);
}

TEST(StepLoopTest, TellsTheScoreOfAGame) {
  std::vector<Seen> seen;
  auto games = VectorEnv::Create({.name = "connect4", .opponents = {"random"}}, 8).value();
  StepLoop loop(std::move(games), {}, Rng(4), Into(&seen));
  const auto policy = UntrainedPolicy(Connect4Spec(), 1);
  for (int step = 0; step < 60; ++step) ASSERT_TRUE(loop.Step(*policy).ok());
  int won = 0, lost = 0;
  for (const Seen& t : seen) {
    if (!t.end.has_value()) continue;
    EXPECT_EQ(t.end->score, (t.reward + 1) / 2);
    EXPECT_EQ(t.end->episode_return, t.reward);
    won += t.end->score == 1;
    lost += t.end->score == 0;
  }
  EXPECT_GT(won, 0);
  EXPECT_GT(lost, 0);
}

TEST(StepLoopTest, JudgesTheActionThatWasTakenByThePushedCritics) {
  const EnvSpec spec = LineEnv().spec();
  for (const double epsilon : {0.0, 1.0}) {
    std::vector<Seen> seen;
    StepLoop loop(MakeLines(kEnvs), {.mode = MODE, .exploration = {.epsilon = epsilon}}, Rng(5), Into(&seen));
    PolicyRunner runner;
    for (const std::uint64_t version : {7, 8, 9}) {
      const auto policy = UntrainedPolicy(spec, version);
      seen.clear();
      ASSERT_TRUE(loop.Step(*policy).ok());
      for (const Seen& t : seen) {
        const PolicyView& view =
            runner.View(*policy, Eigen::Map<const VectorX<float>>(t.observation.data(), 2),
                        Eigen::Map<const VectorX<float>>(t.mask.data(), 3));
        const auto action = static_cast<int>(t.action[0]);
        EXPECT_GT(t.mask[action], 0);
        // The tolerance is a float's precision at the size of the untrained critics' values.
        EXPECT_NEAR(t.advantage, view.q(action, 0) - view.policy.col(0).dot(view.q.col(0)),
                    1e-5 * (1 + view.q.cwiseAbs().maxCoeff()));
        EXPECT_EQ(t.critic_version, version);
      }
    }
    EXPECT_EQ(loop.counters().explored, epsilon > 0 ? 3 * kEnvs : 0);
  }
}

// Returns V(s) from the networks' outputs.
float ValueOf(const PolicyNetworks& policy, const Floats& observation, const Floats& mask) {
  PolicyRunner runner;
  const PolicyView& view = runner.View(policy, Eigen::Map<const VectorX<float>>(observation.data(), 2),
                                       Eigen::Map<const VectorX<float>>(mask.data(), 3));
  return view.policy.col(0).dot(view.q.col(0));
}

TEST(StepLoopTest, WithReturnsEpisodesGoOutWholeAndBootstrapByTheCriticWhereTheyAreCut) {
  constexpr double kDiscount = 0.8, kScale = 2;
  const auto policy = UntrainedPolicy(LineEnv().spec(), 5);
  std::vector<Seen> seen;
  StepLoop loop(MakeLines(kEnvs),
                {.discount = kDiscount, .columns = {.returns = true}, .reward_scale = kScale}, Rng(1),
                Into(&seen));
  for (int step = 0; step < kSteps; ++step) ASSERT_TRUE(loop.Step(*policy).ok());
  EXPECT_EQ(loop.counters().transitions, seen.size() + loop.held_back());
  EXPECT_LE(loop.held_back(), static_cast<std::uint64_t>(kEnvs * LineEnv().spec().max_episode_steps));
  int terminated = 0, cut = 0;
  std::size_t first = 0;
  for (std::size_t last = 0; last < seen.size(); ++last) {
    if (!seen[last].end.has_value()) continue;
    ASSERT_EQ(seen[last].end->length, static_cast<int>(last - first) + 1);
    const bool ends = !LineEnv::IsCut(static_cast<std::uint64_t>(seen[last].seed()));
    ++(ends ? terminated : cut);
    double value = ends ? 0 : ValueOf(*policy, seen[last].next_observation, seen[last].next_mask) / kScale;
    for (std::size_t t = last + 1; t-- > first;) {
      EXPECT_EQ(seen[t].step(), static_cast<float>(t - first));
      value = seen[t].reward + kDiscount * value;
      const double state_value = ValueOf(*policy, seen[t].observation, seen[t].mask);
      constexpr double kDigits = 1e-5;  // the precision of a float
      EXPECT_NEAR(seen[t].monte_carlo_return, value, kDigits * (1 + std::abs(value)));
      EXPECT_NEAR(seen[t].advantage, kScale * value - state_value,
                  kDigits * (1 + kScale * std::abs(value) + std::abs(state_value)));
    }
    first = last + 1;
  }
  EXPECT_EQ(first, seen.size());
  EXPECT_GT(terminated, 5);
  EXPECT_GT(cut, 5);
}

// Expects that two transitions are the same. The rewards' sums may differ in a float's last digit, where they
// are made in another order.
void ExpectSame(const Seen& actual, const Seen& expected) {
  EXPECT_EQ(actual.observation, expected.observation);
  EXPECT_EQ(actual.action, expected.action);
  EXPECT_EQ(actual.mask, expected.mask);
  EXPECT_EQ(actual.next_observation, expected.next_observation);
  EXPECT_EQ(actual.next_mask, expected.next_mask);
  EXPECT_FLOAT_EQ(actual.reward, expected.reward);
  EXPECT_FLOAT_EQ(actual.discount, expected.discount);
  EXPECT_FLOAT_EQ(actual.advantage, expected.advantage);
  EXPECT_EQ(actual.critic_version, expected.critic_version);
  ASSERT_EQ(actual.end.has_value(), expected.end.has_value());
  if (!actual.end.has_value()) return;
  EXPECT_EQ(actual.end->episode_return, expected.end->episode_return);
  EXPECT_EQ(actual.end->length, expected.end->length);
}

// The steps of kEnvs environments as transitions of n steps, by a plain loop over each episode.
std::vector<Seen> WithPlainLoop(const std::vector<Seen>& steps, int n, double discount) {
  std::vector<Seen> transitions;
  for (const PlainNStep& plain :
       PlainNSteps(steps.size(), kEnvs, n, [&](std::size_t i) { return steps[i].end.has_value(); })) {
    Seen transition = steps[plain.steps.front()];
    const Seen& last = steps[plain.steps.back()];
    double sum = 0, factor = 1;
    for (const std::size_t i : plain.steps) {
      sum += factor * steps[i].reward;
      factor *= discount;
    }
    transition.reward = static_cast<float>(sum);
    transition.discount = last.discount == 0 ? 0 : static_cast<float>(factor);
    transition.next_observation = last.next_observation;
    transition.next_mask = last.next_mask;
    transitions.push_back(transition);
  }
  return transitions;
}

TEST(StepLoopTest, TransitionsOfSeveralStepsAreThePlainLoopsOverTheSingleSteps) {
  const std::vector<Seen> steps = Walk({.discount = 0.8}, 1);
  for (int n = 1; n <= 7; ++n) {
    SCOPED_TRACE(n);
    const std::vector<Seen> expected = WithPlainLoop(steps, n, 0.8);
    std::vector<Seen> seen;
    StepLoop loop(MakeLines(kEnvs), {.discount = 0.8, .n_step = n}, Rng(1), Into(&seen));
    const auto policy = UntrainedPolicy(LineEnv().spec(), 5);
    for (int step = 0; step < kSteps; ++step) ASSERT_TRUE(loop.Step(*policy).ok());
    EXPECT_EQ(loop.counters().transitions, seen.size() + loop.held_back());
    EXPECT_EQ(loop.held_back() > 0, n > 1) << "episodes are under way";
    const std::size_t before = seen.size();
    ASSERT_TRUE(loop.Flush().ok());
    EXPECT_EQ(loop.held_back(), 0u);
    ASSERT_EQ(seen.size(), expected.size());
    ASSERT_EQ(seen.size(), steps.size()) << "as many as steps";
    for (std::size_t i = 0; i < seen.size(); ++i) ExpectSame(seen[i], expected[i]);
    for (std::size_t i = before; i < seen.size(); ++i) {
      EXPECT_FALSE(seen[i].end.has_value());
      EXPECT_GT(seen[i].discount, 0);
    }
  }
}

TEST(StepLoopTest, WithReturnsOfItsStartATransitionHasSeveralSteps) {
  const auto walk = [](int n) {
    std::vector<Seen> seen;
    StepLoop loop(MakeLines(kEnvs), {.discount = 0.8, .columns = {.returns = true}, .n_step = n}, Rng(1),
                  Into(&seen));
    const auto policy = UntrainedPolicy(LineEnv().spec(), 5);
    for (int step = 0; step < kSteps; ++step) EXPECT_TRUE(loop.Step(*policy).ok());
    EXPECT_EQ(loop.counters().transitions, seen.size() + loop.held_back());
    return seen;
  };
  const std::vector<Seen> single = walk(1), several = walk(3);
  ASSERT_EQ(single.size(), several.size());
  int whole = 0;
  for (std::size_t first = 0, last = 0; first < single.size(); first = last + 1) {
    for (last = first; !single[last].end.has_value();) ++last;
    for (std::size_t t = first; t <= last; ++t) {
      EXPECT_EQ(several[t].observation, single[t].observation);
      EXPECT_EQ(several[t].monte_carlo_return, single[t].monte_carlo_return);
      EXPECT_EQ(several[t].advantage, single[t].advantage);
      EXPECT_EQ(several[t].end.has_value(), t == last);
      const std::size_t end = std::min(t + 2, last);
      EXPECT_EQ(several[t].next_observation, single[end].next_observation);
      double sum = 0;
      for (std::size_t k = t; k <= end; ++k) sum += std::pow(0.8, k - t) * single[k].reward;
      EXPECT_FLOAT_EQ(several[t].reward, static_cast<float>(sum));
      whole += end == t + 2;
    }
  }
  EXPECT_GT(whole, 20);
}

TEST(StepLoopTest, FlushEndsWithTheErrorOfItsSink) {
  int taken = 0;
  StepLoop loop(MakeLines(kEnvs), {.n_step = 3}, Rng(9),
                [&](const TransitionView&, float, std::uint64_t, const auto&) {
                  return ++taken < 3 ? absl::OkStatus() : absl::CancelledError("closed");
                });
  ASSERT_TRUE(loop.Step(*UntrainedPolicy(LineEnv().spec(), 1)).ok());
  EXPECT_EQ(taken, 0);
  EXPECT_TRUE(absl::IsCancelled(loop.Flush()));
  EXPECT_EQ(taken, 3);
}

TEST(StepLoopTest, WithoutCriticsTransitionsAreNotYetJudged) {
  for (const Seen& t : Walk({}, 6, /*with_critics=*/false)) EXPECT_TRUE(std::isnan(t.advantage));
}

TEST(StepLoopTest, TheSameSeedGivesTheSameTransitions) {
  const StepLoopOptions options = {
      .mode = SAMPLE,
      .exploration = {.epsilon = 0.6, .epsilon_ladder = 2, .epsilon_decay_steps = 200, .final_epsilon = 0.1}};
  const std::vector<Seen> a = Walk(options, 7), b = Walk(options, 7), other = Walk(options, 8);
  int different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].observation, b[i].observation);
    EXPECT_EQ(a[i].action, b[i].action);
    different += a[i].observation != other[i].observation;
  }
  EXPECT_GT(different, 0);
}

TEST(StepLoopTest, EndsWithTheErrorOfItsSink) {
  int taken = 0;
  StepLoop loop(MakeLines(kEnvs), {}, Rng(9), [&](const TransitionView&, float, std::uint64_t, const auto&) {
    return ++taken < 3 ? absl::OkStatus() : absl::CancelledError("closed");
  });
  EXPECT_TRUE(absl::IsCancelled(loop.Step(*UntrainedPolicy(LineEnv().spec(), 1))));
  EXPECT_EQ(loop.counters().transitions, 2);
}

TEST(StepLoopTest, RefusesAModeWhoseNetworksAreMissing) {
  std::vector<Seen> seen;
  StepLoop loop(MakeLines(kEnvs), {.mode = GREEDY_Q}, Rng(10), Into(&seen));
  EXPECT_TRUE(
      absl::IsInvalidArgument(loop.Step(*UntrainedPolicy(LineEnv().spec(), 1, /*with_critics=*/false))));
  EXPECT_TRUE(seen.empty());
}

}  // namespace
}  // namespace dbr
