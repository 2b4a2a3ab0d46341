#include "replay/partitioned_buffer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::Le;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr absl::Time kNow = absl::InfinitePast();      // a deadline for calls that must not wait
constexpr absl::Time kNever = absl::InfiniteFuture();  // a deadline for calls that somebody else lets go on

class Buffer : public ::testing::Test {
 protected:
  Buffer() {
    store_options_.env = "connect4";
    store_options_.layout = kSmallLayout;
    store_options_.capacity = 1000;
    buffer_options_.now = [this] { return now_; };
  }

  void Make() {
    auto store = TransitionStore::Open(store_options_);
    ASSERT_TRUE(store.ok()) << store.status();
    auto buffer = PartitionedBuffer::Make(std::move(*store), buffer_options_);
    ASSERT_TRUE(buffer.ok()) << buffer.status();
    buffer_ = std::move(*buffer);
    place_ = *buffer_->OpenWriter({.id = 1, .name = "actor-0"});
  }

  absl::Status Insert(std::uint64_t first, const Rows& rows, absl::Time deadline = kNow) {
    InsertBatch batch;
    batch.first_sequence = first;
    batch.columns = rows.columns();
    return buffer_->Insert(place_, &batch, deadline);
  }
  // Transitions first ... first + count - 1 with one advantage.
  absl::Status Insert(std::uint64_t first, int count, float advantage = kUnjudged,
                      absl::Time deadline = kNow) {
    return Insert(first, Rows(kSmallLayout, first, count, advantage), deadline);
  }

  absl::Status Draw(std::uint32_t uniform, std::uint32_t plus, std::uint32_t minus, bool allow_empty = true,
                    absl::Time deadline = kNow) {
    return buffer_->Draw({.counts = {uniform, plus, minus}, .allow_empty_partitions = allow_empty},
                         {uniform_.columns(), plus_.columns(), minus_.columns()}, deadline, &result_);
  }

  RelabelResult Relabel(std::uint64_t version, const std::vector<std::uint64_t>& keys,
                        const std::vector<float>& advantages) {
    const auto result = buffer_->Relabel(version, keys, advantages);
    EXPECT_TRUE(result.ok()) << result.status();
    return result.ok() ? *result : RelabelResult();
  }

  absl::Time now_ = absl::FromUnixSeconds(1000);
  StoreOptions store_options_;
  BufferOptions buffer_options_;
  std::unique_ptr<PartitionedBuffer> buffer_;
  std::uint32_t place_ = 0;
  DrawResult result_;
  Drawn uniform_{kSmallLayout, 1000}, plus_{kSmallLayout, 1000}, minus_{kSmallLayout, 1000};
};

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

TEST_F(Buffer, AnEmptyPartitionGivesNothingOrIsWaitedFor) {
  Make();
  ASSERT_TRUE(Insert(1, 10, 1).ok());
  ASSERT_TRUE(Draw(4, 5, 6).ok());
  EXPECT_THAT(result_.drawn, ::testing::ElementsAre(4, 5, 0));
  EXPECT_EQ(buffer_->Stats().counters.sampled, 9u);
  const absl::Status status = Draw(4, 5, 6, /*allow_empty=*/false);
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(status.ToString(),
              AllOf(HasSubstr("partition D- is empty"), HasSubstr("allow_empty_partitions")));
  std::thread relabeller([this] { Relabel(1, {3}, {-1}); });
  EXPECT_TRUE(Draw(4, 5, 6, /*allow_empty=*/false, kNever).ok());
  relabeller.join();
  EXPECT_THAT(std::vector<float>(minus_.rewards.begin(), minus_.rewards.begin() + 6), Each(3));
}

TEST_F(Buffer, RefusesNoAndTooManyDraws) {
  Make();
  ASSERT_TRUE(Insert(1, 10, 1).ok());
  EXPECT_EQ(Draw(0, 0, 0).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Draw(~0u, ~0u, ~0u).code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(Buffer, ADrawWaitsForTheMinimumSize) {
  buffer_options_.limiter.min_size = 20;
  Make();
  ASSERT_TRUE(Insert(1, 19).ok());
  const absl::Status status = Draw(8, 0, 0);
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(status.ToString(),
              AllOf(HasSubstr("rate limiter"), HasSubstr("min_size 20"), HasSubstr("size 19")));
  std::thread writer([this] { EXPECT_TRUE(Insert(20, 1).ok()); });
  EXPECT_TRUE(Draw(8, 0, 0, true, kNever).ok());
  writer.join();
}

TEST_F(Buffer, AnInsertWaitsForDrawsAndGoesOnWhereItStopped) {
  buffer_options_.limiter = {.samples_per_insert = 2, .tolerance = 20, .min_size = 10};
  Make();
  const Rows rows(kSmallLayout, 1, 100);
  InsertBatch batch;
  batch.columns = rows.columns();
  const absl::Status status = buffer_->Insert(place_, &batch, kNow);
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(status.ToString(),
              AllOf(HasSubstr("rate limiter"), HasSubstr("tolerance 20"), HasSubstr("inserted 21")));
  EXPECT_EQ(batch.next_row, 21);  // 2 * (20 - 10) - 0 is not above 20; one more is let in
  EXPECT_EQ(buffer_->Progress(place_).last_sequence, 21u);
  std::thread writer([&] { EXPECT_TRUE(buffer_->Insert(place_, &batch, kNever).ok()); });
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(Draw(40, 0, 0, true, kNever).ok());
  writer.join();
  EXPECT_EQ(buffer_->Stats().total, 100u);
  EXPECT_EQ(buffer_->Stats().counters.duplicates, 0u);
}

TEST_F(Buffer, DuplicatesDoNotWaitForTheLimiter) {
  buffer_options_.limiter = {.samples_per_insert = 2, .tolerance = 20, .min_size = 10};
  Make();
  EXPECT_FALSE(Insert(1, 100).ok());
  EXPECT_TRUE(Insert(1, 21).ok());
  EXPECT_EQ(buffer_->Stats().counters.duplicates, 21u);
}

TEST_F(Buffer, ALargeDrawRaisesTheTolerance) {
  buffer_options_.limiter = {.samples_per_insert = 1, .tolerance = 1, .min_size = 1};
  Make();
  ASSERT_FALSE(Insert(1, 100).ok());
  EXPECT_FALSE(Draw(200, 0, 0).ok());
  EXPECT_EQ(result_.raised_tolerance, 100);
  std::thread writer([this] { EXPECT_TRUE(Insert(1, 150, kUnjudged, kNever).ok()); });
  EXPECT_TRUE(Draw(200, 0, 0, true, kNever).ok());
  EXPECT_EQ(result_.raised_tolerance, 0);
  writer.join();
}

TEST_F(Buffer, InsertsAreFreeWhileADrawWaitsForAnEmptyPartition) {
  buffer_options_.limiter = {.samples_per_insert = 1, .tolerance = 50, .min_size = 10};
  Make();
  ASSERT_EQ(Insert(1, 100, 1).code(), absl::StatusCode::kDeadlineExceeded);  // the limiter holds inserts now
  std::thread learner([this] { EXPECT_TRUE(Draw(10, 10, 10, /*allow_empty=*/false, kNever).ok()); });
  EXPECT_TRUE(Insert(200, 1, -1, kNever).ok());  // only this can help the draw
  learner.join();
}

TEST_F(Buffer, CloseEndsTheWaitOfAnInsert) {
  buffer_options_.limiter = {.samples_per_insert = 1, .tolerance = 10, .min_size = 10};
  Make();
  ASSERT_FALSE(Insert(1, 100).ok());
  std::thread writer(
      [this] { EXPECT_EQ(Insert(500, 10, 1, kNever).code(), absl::StatusCode::kUnavailable); });
  buffer_->Close();
  writer.join();
  EXPECT_EQ(buffer_->OpenWriter({.id = 5, .name = "late"}).status().code(), absl::StatusCode::kUnavailable);
}

TEST_F(Buffer, CloseEndsTheWaitsOfDraws) {
  Make();
  std::thread early(
      [this] { EXPECT_EQ(Draw(1, 0, 0, true, kNever).code(), absl::StatusCode::kUnavailable); });
  buffer_->Close();
  early.join();
  EXPECT_EQ(Draw(1, 0, 0, true, kNever).code(), absl::StatusCode::kUnavailable);
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

TEST_F(Buffer, CountsEpisodesOnce) {
  Make();
  EXPECT_TRUE(std::isnan(buffer_->Stats().recent_return_mean));
  const Rows rows(kSmallLayout, 1, 4);
  const std::vector<RowEnd> ends = {{1, {1.0f, 1.0f, 10}}, {3, {-1.0f, 0.5f, 20}}};
  for (int times = 0; times < 2; ++times) {
    InsertBatch batch;
    batch.columns = rows.columns();
    batch.ends = ends;
    ASSERT_TRUE(buffer_->Insert(place_, &batch, kNow).ok());
  }
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.counters.episodes, 2u);
  EXPECT_EQ(stats.recent_return_mean, 0);
  EXPECT_EQ(stats.recent_score_mean, 0.75);
  EXPECT_EQ(stats.recent_length_mean, 15);
}

TEST_F(Buffer, TellsRatesOverTheLastSeconds) {
  Make();
  ASSERT_TRUE(Insert(1, 100).ok());
  now_ += absl::Seconds(2);
  ASSERT_TRUE(Insert(101, 100).ok());
  ASSERT_TRUE(Draw(50, 0, 0).ok());
  EXPECT_DOUBLE_EQ(buffer_->Stats().insert_rate, 100);
  EXPECT_DOUBLE_EQ(buffer_->Stats().sample_rate, 25);
  now_ += absl::Seconds(60);
  EXPECT_EQ(buffer_->Stats().insert_rate, 0);
  EXPECT_EQ(buffer_->Stats().uptime_s, 62);
}

TEST_F(Buffer, TellsTheAgeOfLabelsAndTheirHistogram) {
  Make();
  ASSERT_TRUE(Insert(1, 100).ok());
  std::vector<std::uint64_t> keys;
  for (std::uint64_t key = 1; key <= 20; ++key) keys.push_back(key);
  Relabel(10, keys, std::vector<float>(20, 0.25f));
  keys.resize(10);
  Relabel(14, keys, std::vector<float>(10, -1.5f));
  const LabelSummary labels = buffer_->Stats().labels;
  EXPECT_DOUBLE_EQ(labels.age_mean, 2);
  EXPECT_DOUBLE_EQ(labels.age_p95, 4);
  ASSERT_EQ(labels.edges.size(), labels.histogram.size() + 1);
  EXPECT_DOUBLE_EQ(labels.edges.front(), -2);
  EXPECT_DOUBLE_EQ(labels.edges.back(), 2);
  for (std::size_t bin = 0; bin < labels.histogram.size(); ++bin) {
    std::uint64_t expected = 0;
    if (labels.edges[bin] <= 0.25 && 0.25 < labels.edges[bin + 1]) expected += 10;
    if (labels.edges[bin] <= -1.5 && -1.5 < labels.edges[bin + 1]) expected += 10;
    EXPECT_EQ(labels.histogram[bin], expected) << "bin " << bin;
  }
}

TEST_F(Buffer, CountsRowsBySource) {
  store_options_.capacity = 30;
  Make();
  place_ = *buffer_->OpenWriter({.id = 9, .name = "offline", .source = Source::kSeed});
  ASSERT_TRUE(Insert(1, 10, 1).ok());
  ASSERT_TRUE(Insert(11, 10, -1).ok());
  place_ = *buffer_->OpenWriter({.id = 1, .name = "actor-0"});
  ASSERT_TRUE(Insert(1, 15, 1).ok());  // evicts five of the seed
  BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.seed, 15u);
  EXPECT_EQ(stats.seed_plus, 5u);
  EXPECT_EQ(stats.seed_minus, 10u);
  Relabel(1, {11}, {1});
  stats = buffer_->Stats();
  EXPECT_EQ(stats.seed_plus, 6u);
  EXPECT_EQ(stats.seed_minus, 9u);
}

TEST_F(Buffer, ResumesItsPartitions) {
  TestFolder folder;
  store_options_.path = absl::StrCat(folder.path(), "/replay.store");
  Make();
  ASSERT_TRUE(Insert(1, 10, 1).ok());
  ASSERT_TRUE(Insert(11, 20, -1).ok());
  ASSERT_TRUE(Insert(31, 5).ok());
  Relabel(3, {1, 2}, {-1, 0});
  buffer_.reset();
  store_options_.resume = true;
  Make();
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.plus, 9u);
  EXPECT_EQ(stats.minus, 22u);
  EXPECT_EQ(stats.unjudged, 5u);
  EXPECT_EQ(stats.counters.relabelled, 2u);
  EXPECT_EQ(buffer_->Progress(place_).last_sequence, 35u);
  EXPECT_EQ(Relabel(2, {1}, {1}).stale, 1u);
  ASSERT_TRUE(Insert(30, 10).ok());
  EXPECT_EQ(buffer_->Stats().counters.duplicates, 6u);
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  uniform_.ExpectWhole(1000);
}

TEST_F(Buffer, GivesPlacesOfWritersThatAreGoneToNewOnes) {
  store_options_.capacity = 1;
  Make();
  ASSERT_TRUE(Insert(1, 1).ok());
  for (std::uint64_t id = 2; id < 3 * WriterTable::kPlaces; ++id) {
    const auto place = buffer_->OpenWriter({.id = id, .name = "passing"});
    ASSERT_TRUE(place.ok()) << place.status();
    buffer_->CloseWriter(*place);
  }
  ASSERT_TRUE(Insert(1, 1).ok());
  EXPECT_EQ(buffer_->Stats().counters.duplicates, 1u);  // the one that is connected was not forgotten
  absl::Status status;
  for (std::uint64_t id = 2; id < 3 * WriterTable::kPlaces && status.ok(); ++id) {
    status = buffer_->OpenWriter({.id = id, .name = "staying"}).status();
  }
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
}

TEST_F(Buffer, RefusesWritersWithoutNameOrId) {
  Make();
  EXPECT_THAT(buffer_->OpenWriter({.id = 0, .name = "x"}).status().ToString(), HasSubstr("writer_id"));
  EXPECT_THAT(buffer_->OpenWriter({.id = 1, .name = ""}).status().ToString(), HasSubstr("writer_name"));
  EXPECT_THAT(buffer_->OpenWriter({.id = 1, .name = std::string(64, 'x')}).status().ToString(),
              HasSubstr("found 64"));
}

}  // namespace
}  // namespace dbr
