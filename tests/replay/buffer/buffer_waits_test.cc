// How inserts and draws wait for each other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "core/monotonic_clock.h"
#include "tests/replay/buffer/buffer_fixture.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::HasSubstr;

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

// A broken connection does this: the writer sends again on another one what the first still waits to store.
TEST_F(Buffer, TwoStreamsOfOneWriterThatWaitTogetherStoreEachRowOnce) {
  buffer_options_.limiter = {.samples_per_insert = 2, .tolerance = 20, .min_size = 10};
  Make();
  EXPECT_FALSE(Insert(1, 100).ok());                               // 21 of them are in
  const absl::Time patience = MonotonicNow() + absl::Seconds(20);  // only a failure waits that long
  std::vector<std::thread> streams;
  for (int i = 0; i < 2; ++i)
    streams.emplace_back([&] { EXPECT_TRUE(Insert(22, 40, kUnjudged, patience).ok()); });
  const auto waiting = [this] {
    const std::vector<BlockedCalls> blocked = buffer_->Stats().blocked;
    return blocked.empty() ? 0 : blocked[0].clients;
  };
  while (waiting() < 2) std::this_thread::yield();
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(Draw(40, 0, 0, true, patience).ok());
  for (std::thread& stream : streams) stream.join();
  EXPECT_EQ(buffer_->Stats().total, 61u);
  EXPECT_EQ(buffer_->Stats().counters.duplicates, 40u);
  EXPECT_EQ(buffer_->Progress(place_).last_sequence, 61u);
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

// How many clients of the buffer wait in `call`.
std::uint64_t Waiting(const PartitionedBuffer& buffer, const std::string& call) {
  for (const BlockedCalls& blocked : buffer.Stats().blocked) {
    if (blocked.call == call) return blocked.clients;
  }
  return 0;
}

TEST_F(Buffer, CloseWakesAnInsertThatWaits) {
  buffer_options_.limiter = {.samples_per_insert = 1, .tolerance = 10, .min_size = 10};
  Make();
  ASSERT_FALSE(Insert(1, 100).ok());
  const absl::Time patience = MonotonicNow() + absl::Seconds(20);  // only a failure waits that long
  std::thread writer([&] { EXPECT_EQ(Insert(500, 10, 1, patience).code(), absl::StatusCode::kUnavailable); });
  while (Waiting(*buffer_, "insert") == 0 && MonotonicNow() < patience) std::this_thread::yield();
  buffer_->Close();
  writer.join();
  EXPECT_LT(MonotonicNow(), patience) << "the deadline ended the wait, and not Close";
  EXPECT_EQ(buffer_->OpenWriter({.id = 5, .name = "late"}).status().code(), absl::StatusCode::kUnavailable);
}

TEST_F(Buffer, CloseWakesDrawsThatWaitAndRefusesLaterOnes) {
  Make();
  const absl::Time patience = MonotonicNow() + absl::Seconds(20);
  std::thread early([&] { EXPECT_EQ(Draw(1, 0, 0, true, patience).code(), absl::StatusCode::kUnavailable); });
  while (Waiting(*buffer_, "sample") == 0 && MonotonicNow() < patience) std::this_thread::yield();
  buffer_->Close();
  early.join();
  EXPECT_LT(MonotonicNow(), patience) << "the deadline ended the wait, and not Close";
  EXPECT_EQ(Draw(1, 0, 0, true, patience).code(), absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace dbr
