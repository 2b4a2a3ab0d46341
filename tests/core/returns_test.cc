#include "core/returns.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace dbr {
namespace {

constexpr TransitionLayout kLayout{
    .observation_width = 2, .action_width = 1, .mask_width = 2, .return_width = 1};

// Rows with these rewards and discounts.
std::vector<float> Rows(const std::vector<float>& rewards, const std::vector<float>& discounts) {
  std::vector<float> rows;
  for (std::size_t t = 0; t < rewards.size(); ++t) {
    const float step = static_cast<float>(t);
    const float observation[2] = {step, 1}, action[1] = {0}, mask[2] = {1, 0}, next[2] = {step + 1, 1};
    rows.resize(rows.size() + kLayout.stride());
    WriteRow({.observation = observation,
              .action = action,
              .mask = mask,
              .reward = rewards[t],
              .discount = discounts[t],
              .next_observation = next,
              .next_mask = mask},
             kLayout, rows.data() + t * kLayout.stride());
  }
  return rows;
}

std::vector<float> ReturnsOf(const std::vector<float>& rows) {
  std::vector<float> returns;
  for (std::size_t from = 0; from < rows.size(); from += kLayout.stride())
    returns.push_back(ViewRow(rows.data() + from, kLayout).monte_carlo_return);
  return returns;
}

TEST(FillReturnsTest, SumsBackwardsFromTheValueBehindACut) {
  std::vector<float> rows = Rows({1, 2, 4}, {0.5f, 0.5f, 0.5f});
  FillReturns(kLayout, 8, absl::MakeSpan(rows));
  EXPECT_THAT(ReturnsOf(rows), testing::ElementsAre(1 + 0.5f * 6, 2 + 0.5f * 8, 4 + 0.5f * 8));
}

TEST(FillReturnsTest, NothingComesAfterATerminal) {
  std::vector<float> rows = Rows({1, 2, 4}, {0.5f, 0.5f, 0});
  FillReturns(kLayout, NAN, absl::MakeSpan(rows));
  EXPECT_THAT(ReturnsOf(rows), testing::ElementsAre(3, 4, 4));
}

TEST(FillReturnsTest, LeavesTheRestOfARowAlone) {
  std::vector<float> rows = Rows({1, 2}, {0.5f, 0});
  FillReturns(kLayout, 0, absl::MakeSpan(rows));
  const TransitionView row = ViewRow(rows.data() + kLayout.stride(), kLayout);
  EXPECT_THAT(row.observation, testing::ElementsAre(1, 1));
  EXPECT_THAT(row.mask, testing::ElementsAre(1, 0));
  EXPECT_EQ(row.reward, 2);
  EXPECT_THAT(row.next_observation, testing::ElementsAre(2, 1));
  EXPECT_THAT(row.next_mask, testing::ElementsAre(1, 0));
}

TEST(StationaryContinuationTest, TakesTheLastRewardsToGoOnForEver) {
  const std::vector<float> rows = Rows({100, 1, 2, 4, 5}, {0.75f, 0.75f, 0.75f, 0.75f, 0.75f});
  EXPECT_DOUBLE_EQ(StationaryContinuation(kLayout, 0.75, rows), (1 + 2 + 4 + 5) / 4.0 / 0.25);
  EXPECT_DOUBLE_EQ(StationaryContinuation(kLayout, 0.99, rows), (100 + 1 + 2 + 4 + 5) / 5.0 / (1 - 0.99));
  EXPECT_DOUBLE_EQ(StationaryContinuation(kLayout, 0, rows), 5);
}

TEST(TransitionLayoutTest, AReturnTakesOneFloatBetweenDiscountAndNextObservation) {
  const EnvSpec spec{.name = "test", .observation_size = 2, .actions = {ActionKind::kDiscrete, 2}};
  const TransitionLayout without = TransitionLayout::Of(spec),
                         with = TransitionLayout::Of(spec, {.returns = true});
  EXPECT_EQ(with, kLayout);
  EXPECT_EQ(with.stride(), without.stride() + 1);
  EXPECT_EQ(with.return_offset(), without.discount_offset() + 1);
  EXPECT_EQ(with.next_observation_offset(), without.next_observation_offset() + 1);
}

}  // namespace
}  // namespace dbr
