// Partitions, inserts, draws and relabels.
#include "replay/buffer/partitioned_buffer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/replay/buffer/buffer_fixture.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::Le;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST_F(Buffer, PartitionsByTheSignOfTheAdvantage) {
  Make();
  ASSERT_TRUE(Insert(1, 10, 0.5f).ok());
  ASSERT_TRUE(Insert(11, 20, -0.5f).ok());
  ASSERT_TRUE(Insert(31, 5, 0.0f).ok());
  ASSERT_TRUE(Insert(36, 7).ok());
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.total, 42u);
  EXPECT_EQ(stats.plus, 15u);  // zero is in both
  EXPECT_EQ(stats.minus, 25u);
  EXPECT_EQ(stats.unjudged, 7u);
}

TEST_F(Buffer, DrawsWholeRowsOfTheAskedPartitions) {
  Make();
  ASSERT_TRUE(Insert(1, 10, 0.5f).ok());
  ASSERT_TRUE(Insert(11, 20, -0.5f).ok());
  ASSERT_TRUE(Insert(31, 5).ok());
  ASSERT_TRUE(Draw(1000, 500, 300).ok());
  EXPECT_THAT(result_.drawn, ::testing::ElementsAre(1000, 500, 300));
  uniform_.ExpectWhole(1000);
  plus_.ExpectWhole(500);
  minus_.ExpectWhole(300);
  EXPECT_THAT(std::vector<float>(plus_.rewards.begin(), plus_.rewards.begin() + 500),
              Each(AllOf(Ge(1), Le(10))));
  EXPECT_THAT(std::vector<float>(minus_.rewards.begin(), minus_.rewards.begin() + 300),
              Each(AllOf(Ge(11), Le(30))));
  EXPECT_EQ(result_.total, 35u);
  EXPECT_EQ(result_.plus, 10u);
  EXPECT_EQ(result_.minus, 20u);
  EXPECT_EQ(result_.unjudged, 5u);
  EXPECT_EQ(result_.inserted, 35u);
}

TEST_F(Buffer, DrawsReturnsWithTheirRows) {
  store_options_.layout = kLayoutWithReturns;
  Make();
  ASSERT_TRUE(Insert(1, Rows(kLayoutWithReturns, 1, 200, 0.0f)).ok());
  Drawn drawn(kLayoutWithReturns, 500);
  ASSERT_TRUE(buffer_
                  ->Draw({.counts = {0, 500, 0}, .allow_empty_partitions = false},
                         {uniform_.columns(), drawn.columns(), minus_.columns()}, kNow, &result_)
                  .ok());
  drawn.ExpectWhole(500);
}

TEST_F(Buffer, RefusesAReturnThatIsNotFinite) {
  store_options_.layout = kLayoutWithReturns;
  Make();
  Rows rows(kLayoutWithReturns, 1, 3, 1.0f);
  rows.returns[1] = INFINITY;
  ASSERT_TRUE(Insert(1, rows).ok());
  EXPECT_EQ(buffer_->Stats().total, 2u);
  EXPECT_EQ(buffer_->Stats().counters.refused, 1u);
}

TEST_F(Buffer, EvictsTheOldestFirst) {
  store_options_.capacity = 10;
  Make();
  ASSERT_TRUE(Insert(1, 10, 1).ok());
  ASSERT_TRUE(Insert(11, 4, -1).ok());
  ASSERT_TRUE(Draw(1000, 1000, 1000).ok());
  EXPECT_THAT(uniform_.rewards, Each(Ge(5)));
  EXPECT_THAT(plus_.rewards, Each(AllOf(Ge(5), Le(10))));
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.plus, 6u);
  EXPECT_EQ(stats.minus, 4u);
  EXPECT_EQ(stats.evicted, 4u);
  EXPECT_EQ(stats.writers[0].held, 10u);
  EXPECT_EQ(stats.writers[0].inserted, 14u);
}

TEST_F(Buffer, DropsWhatAWriterSendsTwice) {
  Make();
  ASSERT_TRUE(Insert(1, 10, 1).ok());
  ASSERT_TRUE(Insert(6, 10, 1).ok());
  EXPECT_EQ(buffer_->Progress(place_).last_sequence, 15u);
  const std::uint32_t other = *buffer_->OpenWriter({.id = 2, .name = "actor-1"});
  const Rows rows(kSmallLayout, 1, 3);
  InsertBatch batch;
  batch.columns = rows.columns();
  ASSERT_TRUE(
      buffer_->Insert(other, &batch, kNow).ok());  // the same numbers of another writer are not the same
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.total, 18u);
  EXPECT_EQ(stats.counters.duplicates, 5u);
  EXPECT_EQ(stats.writers[0].duplicates, 5u);
  EXPECT_EQ(stats.writers[1].duplicates, 0u);
}

TEST_F(Buffer, TakesAGapButNeverALowerNumberAgain) {
  Make();
  ASSERT_TRUE(Insert(100, 5).ok());
  ASSERT_TRUE(Insert(50, 5).ok());
  EXPECT_EQ(buffer_->Stats().total, 5u);
  EXPECT_EQ(buffer_->Stats().counters.duplicates, 5u);
  EXPECT_EQ(buffer_->Progress(place_).last_sequence, 104u);
}

TEST_F(Buffer, RefusesNonFiniteValuesAndCountsThemByWriter) {
  Make();
  Rows rows(kSmallLayout, 1, 12, 1.0f);
  rows.observations[4 * 1 + 2] = kInfinity;
  rows.actions[2] = kUnjudged;
  rows.masks[3 * 3] = -kInfinity;
  rows.rewards[4] = kUnjudged;
  rows.discounts[5] = kInfinity;
  rows.next_observations[4 * 6] = kUnjudged;
  rows.next_masks[3 * 7 + 1] = kInfinity;
  rows.advantages[8] = kInfinity;
  rows.actions[9] = 3;      // of three actions
  rows.actions[10] = 0.5f;  // no index
  ASSERT_TRUE(Insert(1, rows).ok());
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.total, 2u);
  EXPECT_EQ(stats.counters.refused, 10u);
  EXPECT_EQ(stats.writers[0].refused, 10u);
  EXPECT_EQ(buffer_->Progress(place_).refused, 10u);
  EXPECT_EQ(buffer_->Progress(place_).last_sequence, 12u);
  ASSERT_TRUE(Insert(1, rows).ok());  // refused once, and for good
  EXPECT_EQ(buffer_->Stats().counters.refused, 10u);
}

TEST_F(Buffer, RelabelsMoveRowsBetweenPartitions) {
  Make();
  ASSERT_TRUE(Insert(1, 10).ok());
  const RelabelResult result = Relabel(5, {1, 2, 3, 99}, {1, -1, 0, 1});
  EXPECT_EQ(result.relabelled, 3u);
  EXPECT_EQ(result.evicted, 1u);
  BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.plus, 2u);
  EXPECT_EQ(stats.minus, 2u);
  EXPECT_EQ(stats.unjudged, 7u);
  Relabel(6, {1, 3}, {-2, -2});
  stats = buffer_->Stats();
  EXPECT_EQ(stats.plus, 0u);
  EXPECT_EQ(stats.minus, 3u);
  EXPECT_EQ(stats.counters.relabelled, 5u);
  EXPECT_EQ(stats.counters.relabel_evicted, 1u);
}

TEST_F(Buffer, AnOlderCriticNeverOverwritesANewerOne) {
  Make();
  ASSERT_TRUE(Insert(1, 3).ok());
  Relabel(7, {1, 2}, {1, 1});
  const RelabelResult older = Relabel(6, {1, 3}, {-1, -1});
  EXPECT_EQ(older.stale, 1u);
  EXPECT_EQ(older.relabelled, 1u);
  const RelabelResult same = Relabel(7, {2}, {-1});
  EXPECT_EQ(same.relabelled, 1u);
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.plus, 1u);
  EXPECT_EQ(stats.minus, 2u);
  EXPECT_EQ(stats.counters.relabel_stale, 1u);
}

TEST_F(Buffer, RefusesRelabelsThatMakeNoSense) {
  Make();
  ASSERT_TRUE(Insert(1, 3, 1).ok());
  EXPECT_EQ(Relabel(1, {1, 2}, {kUnjudged, -kInfinity}).refused, 2u);
  EXPECT_EQ(Relabel(1, {0, ~std::uint64_t{0}}, {1, 1}).evicted, 2u);
  EXPECT_EQ(buffer_->Stats().plus, 3u);
  const std::vector<std::uint64_t> keys = {1, 2};
  const std::vector<float> advantages = {1};
  EXPECT_THAT(buffer_->Relabel(1, keys, advantages).status().ToString(),
              HasSubstr("2 keys and 1 advantages"));
  const std::vector<std::uint64_t> many(PartitionedBuffer::kMaxRelabels + 1);
  EXPECT_EQ(buffer_->Relabel(1, many, std::vector<float>(many.size())).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(Buffer, AccumulatesAdvantagesWhereAsked) {
  buffer_options_.cumulative_advantage = true;
  Make();
  ASSERT_TRUE(Insert(1, 1, -5.0f).ok());
  Relabel(1, {1}, {2});   // max(-5, 0) + 2 = 2
  Relabel(2, {1}, {-1});  // 2 - 1 = 1
  EXPECT_EQ(buffer_->Stats().plus, 1u);
  Relabel(3, {1}, {-3});  // 1 - 3 = -2
  EXPECT_EQ(buffer_->Stats().minus, 1u);
  Relabel(4, {1}, {0});  // max(-2, 0) + 0 = 0: in both
  EXPECT_EQ(buffer_->Stats().plus, 1u);
  EXPECT_EQ(buffer_->Stats().minus, 1u);
  ASSERT_TRUE(Insert(2, 1).ok());
  Relabel(4, {2}, {-1});  // a row not yet judged begins with its first advantage
  EXPECT_EQ(buffer_->Stats().minus, 2u);
}

TEST_F(Buffer, RefusesNoAndTooManyDraws) {
  Make();
  ASSERT_TRUE(Insert(1, 10, 1).ok());
  EXPECT_EQ(Draw(0, 0, 0).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Draw(~0u, ~0u, ~0u).code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(Buffer, RefusesSequencesAndEndsThatMakeNoSense) {
  Make();
  const Rows rows(kSmallLayout, 1, 4);
  EXPECT_THAT(Insert(0, rows).ToString(), HasSubstr("first_sequence"));
  EXPECT_THAT(Insert(~std::uint64_t{0}, rows).ToString(), HasSubstr("first_sequence"));
  for (const std::vector<RowEnd>& ends :
       std::vector<std::vector<RowEnd>>{{{4, {}}}, {{-1, {}}}, {{2, {}}, {1, {}}}, {{1, {}}, {1, {}}}}) {
    InsertBatch batch;
    batch.columns = rows.columns();
    batch.ends = ends;
    EXPECT_THAT(buffer_->Insert(place_, &batch, kNow).ToString(), HasSubstr("episode_ends"));
  }
  EXPECT_EQ(buffer_->Stats().total, 0u);
}

}  // namespace
}  // namespace dbr
