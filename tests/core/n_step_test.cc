#include "core/n_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/rng.h"

namespace dbr {
namespace {

using Row = std::vector<float>;

constexpr TransitionLayout kLayout{
    .observation_width = 2, .action_width = 1, .mask_width = 3, .return_width = 1};

enum class Ending { kTerminal, kCut, kOpen };

// An episode of single steps; observation t is {number, t}, and everything else is random.
struct Episode {
  std::vector<Row> rows;
  Ending ending;
};

// The views of a step, in memory of its own.
struct Step {
  Step(float number, int t, Rng& rng, float discount)
      : observation{number, static_cast<float>(t)},
        action{static_cast<float>(rng.Below(3))},
        mask{1, static_cast<float>(t), 0},
        next_observation{number, static_cast<float>(t + 1)},
        next_mask{1, static_cast<float>(t + 1), 0},
        view{.observation = observation,
             .action = action,
             .mask = mask,
             .reward = static_cast<float>(rng.Normal()),
             .discount = discount,
             .next_observation = next_observation,
             .next_mask = next_mask,
             .monte_carlo_return = static_cast<float>(rng.Normal())} {}

  Row observation, action, mask, next_observation, next_mask;
  TransitionView view;
};

Row RowOf(const TransitionView& transition) {
  Row row(static_cast<std::size_t>(kLayout.stride()));
  WriteRow(transition, kLayout, row.data());
  return row;
}

Episode MakeEpisode(float number, int length, Ending ending, float discount, Rng& rng) {
  Episode episode{.rows = {}, .ending = ending};
  for (int t = 0; t < length; ++t) {
    const bool terminal = ending == Ending::kTerminal && t + 1 == length;
    episode.rows.push_back(RowOf(Step(number, t, rng, terminal ? 0 : discount).view));
  }
  return episode;
}

// The transition of n steps that starts at step t, by the definition.
Row PlainLoop(const Episode& episode, int t, int n, double discount) {
  const int end = std::min(t + n, static_cast<int>(episode.rows.size()));
  const Row& last = episode.rows[end - 1];
  Row row = episode.rows[t];
  if (n > 1) {
    double sum = 0;
    for (int k = t; k < end; ++k) sum += std::pow(discount, k - t) * episode.rows[k][kLayout.reward_offset()];
    row[kLayout.reward_offset()] = static_cast<float>(sum);
    const bool terminal = episode.ending == Ending::kTerminal && end == static_cast<int>(episode.rows.size());
    row[kLayout.discount_offset()] = terminal ? 0 : static_cast<float>(std::pow(discount, end - t));
  }
  std::copy(last.begin() + kLayout.next_observation_offset(), last.end(),
            row.begin() + kLayout.next_observation_offset());
  return row;
}

// A transition as it was emitted.
struct Out {
  Row row;
  FirstJudgement judgement;
  bool is_last;
};

auto Into(std::vector<Out>* out) {
  return [out](const TransitionView& transition, const FirstJudgement& judgement, bool is_last) {
    out->push_back({RowOf(transition), judgement, is_last});
    return absl::OkStatus();
  };
}

// Adds the episode; its steps have the advantages 0, 1, 2 and so on.
void Add(const Episode& episode, NStepAccumulator* steps, std::vector<Out>* out) {
  for (std::size_t t = 0; t < episode.rows.size(); ++t) {
    const bool ends = t + 1 == episode.rows.size() && episode.ending != Ending::kOpen;
    const Row step = episode.rows[t];  // gone after the call
    ASSERT_TRUE(
        steps->Add(ViewRow(step.data(), kLayout), {static_cast<float>(t), t + 7}, ends, Into(out)).ok());
  }
}

// Sums in another order differ in double's last digits, which may turn the rounding to a float.
void ExpectSameRow(const Row& actual, const Row& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (int i = 0; i < kLayout.stride(); ++i) {
    if (i == kLayout.reward_offset() || i == kLayout.discount_offset()) {
      EXPECT_NEAR(actual[i], expected[i], 1e-6 * (1 + std::abs(expected[i]))) << "float " << i;
    } else {
      EXPECT_EQ(actual[i], expected[i]) << "float " << i;
    }
  }
  EXPECT_EQ(actual[kLayout.discount_offset()] == 0, expected[kLayout.discount_offset()] == 0);
}

class NStepTest : public testing::TestWithParam<int> {};

TEST_P(NStepTest, GivesThePlainLoopsTransitionsInTheOrderOfTheSteps) {
  constexpr float kDiscount = 0.9f;
  const int n = GetParam();
  Rng rng(static_cast<std::uint64_t>(n));
  NStepAccumulator steps(kLayout, n);
  int shorter_than_n = 0;
  for (int number = 0; number < 200; ++number) {
    const int length = 1 + static_cast<int>(rng.Below(12));
    const Episode episode = MakeEpisode(static_cast<float>(number), length,
                                        rng.Below(2) == 0 ? Ending::kTerminal : Ending::kCut, kDiscount, rng);
    shorter_than_n += length < n;
    std::vector<Out> out;
    Add(episode, &steps, &out);
    ASSERT_EQ(out.size(), episode.rows.size()) << "as many as steps";
    EXPECT_EQ(steps.waiting(), 0u) << "nothing crosses into the next episode";
    for (int t = 0; t < length; ++t) {
      ExpectSameRow(out[t].row, PlainLoop(episode, t, n, kDiscount));
      EXPECT_EQ(out[t].judgement.advantage, static_cast<float>(t));
      EXPECT_EQ(out[t].judgement.critic_version, static_cast<std::uint64_t>(t) + 7);
      EXPECT_EQ(out[t].is_last, t + 1 == length);
    }
  }
  EXPECT_EQ(shorter_than_n > 0, n > 1);
}

TEST_P(NStepTest, WhatWaitsIsFlushedWithFewerSteps) {
  const int n = GetParam();
  Rng rng(3);
  NStepAccumulator steps(kLayout, n);
  for (int length = 1; length <= 9; ++length) {
    const Episode episode = MakeEpisode(1, length, Ending::kOpen, 0.5f, rng);
    std::vector<Out> out;
    Add(episode, &steps, &out);
    EXPECT_EQ(steps.waiting(), static_cast<std::size_t>(std::min(length, n - 1)));
    EXPECT_EQ(out.size() + steps.waiting(), episode.rows.size());
    ASSERT_TRUE(steps.Flush(Into(&out)).ok());
    ASSERT_EQ(out.size(), episode.rows.size());
    for (int t = 0; t < length; ++t) {
      ExpectSameRow(out[t].row, PlainLoop(episode, t, n, 0.5));
      EXPECT_FALSE(out[t].is_last) << "the episode goes on";
    }
    EXPECT_EQ(steps.waiting(), 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Steps, NStepTest, testing::Range(1, 8));

// Bit for bit: a negative zero and a NaN stay, too.
TEST(OneStepTest, PassesEachStepThroughAsItIs) {
  Rng rng(1);
  Step step(5, 0, rng, 0.99f);
  step.view.reward = -0.0f;
  step.view.monte_carlo_return = NAN;
  NStepAccumulator steps(kLayout, 1);
  int emitted = 0;
  for (const bool ends : {false, true}) {
    ASSERT_TRUE(
        steps
            .Add(step.view, {0.5f, 3}, ends,
                 [&](const TransitionView& transition, const FirstJudgement& judgement, bool is_last) {
                   EXPECT_EQ(transition.observation.data(), step.observation.data());
                   EXPECT_EQ(transition.next_mask.data(), step.next_mask.data());
                   EXPECT_TRUE(std::signbit(transition.reward));
                   EXPECT_TRUE(std::isnan(transition.monte_carlo_return));
                   EXPECT_EQ(transition.discount, 0.99f);
                   EXPECT_EQ(judgement.advantage, 0.5f);
                   EXPECT_EQ(is_last, ends);
                   ++emitted;
                   return absl::OkStatus();
                 })
            .ok());
  }
  EXPECT_EQ(emitted, 2);
  EXPECT_EQ(steps.waiting(), 0u);
}

TEST(NStepSumsTest, ADiscountOfZeroCountsTheFirstRewardAlone) {
  Rng rng(2);
  const Episode episode = MakeEpisode(1, 4, Ending::kCut, 0, rng);
  NStepAccumulator steps(kLayout, 3);
  std::vector<Out> out;
  Add(episode, &steps, &out);
  ASSERT_EQ(out.size(), 4u);
  for (int t = 0; t < 4; ++t) {
    EXPECT_EQ(out[t].row[kLayout.reward_offset()], episode.rows[t][kLayout.reward_offset()]);
    EXPECT_EQ(out[t].row[kLayout.discount_offset()], 0);
  }
}

TEST(NStepErrorTest, GivesTheFirstErrorAndKeepsTheRest) {
  Rng rng(2);
  const Episode episode = MakeEpisode(1, 3, Ending::kOpen, 0.5f, rng);
  NStepAccumulator steps(kLayout, 4);
  std::vector<Out> out;
  Add(episode, &steps, &out);
  const auto fail = [](const TransitionView&, const FirstJudgement&, bool) {
    return absl::CancelledError("closed");
  };
  EXPECT_TRUE(absl::IsCancelled(steps.Flush(fail)));
  EXPECT_EQ(steps.waiting(), 2u);
}

}  // namespace
}  // namespace dbr
