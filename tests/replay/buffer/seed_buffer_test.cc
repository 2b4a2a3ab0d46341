// A buffer that is begun with offline data.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "tests/replay/buffer/buffer_fixture.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::Le;

class BufferWithSeedBuffer : public Buffer {
 protected:
  BufferWithSeedBuffer() { store_options_.capacity = 100; }

  // Transitions first ... first + count - 1 as the seed buffer's.
  absl::Status InsertSeedBuffer(std::uint64_t first, int count) {
    const Rows rows(kSmallLayout, first, count);
    std::vector<float> flat;
    for (int i = 0; i < count; ++i) rows.AppendFlat(i, &flat);
    return buffer_->InsertSeedBuffer(flat);
  }
  void MakeSeeded(int rows, bool pin = true) {
    Make();
    ASSERT_TRUE(InsertSeedBuffer(1, rows).ok());
    ASSERT_TRUE(buffer_->CompleteSeedBuffer({.episodes = 4, .return_mean = 12.5}, pin).ok());
  }
  // How many of the first `count` drawn rows are the seed buffer's, whose transitions are 1 to `rows`.
  static std::int64_t SeedBufferAmong(const Drawn& drawn, std::size_t count, float rows) {
    return std::count_if(drawn.rewards.begin(), drawn.rewards.begin() + static_cast<std::ptrdiff_t>(count),
                         [rows](float reward) { return reward <= rows; });
  }
};

TEST_F(BufferWithSeedBuffer, TakesWholeRowsNotYetJudged) {
  store_options_.capacity = 10000;
  MakeSeeded(9000);  // more than one lock's
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.total, 9000u);
  EXPECT_EQ(stats.unjudged, 9000u);
  EXPECT_EQ(stats.seed_buffer, 9000u);
  EXPECT_EQ(stats.seed_buffer_rows, 9000u);
  EXPECT_EQ(stats.inserted, 0u);
  EXPECT_EQ(stats.counters.episodes, 0u);
  EXPECT_EQ(stats.seed_buffer_record.rows, 9000u);
  EXPECT_EQ(stats.seed_buffer_record.episodes, 4u);
  EXPECT_EQ(stats.seed_buffer_record.return_mean, 12.5);
  ASSERT_EQ(stats.writers.size(), 2u);  // actor-0 came first
  EXPECT_EQ(stats.writers[1].identity.source, Source::kSeedBuffer);
  EXPECT_EQ(stats.writers[1].held, 9000u);
  EXPECT_FALSE(stats.writers[1].connected);
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  uniform_.ExpectWhole(1000);
}

TEST_F(BufferWithSeedBuffer, OnlineRowsNeverDriveAPinnedSeedOut) {
  MakeSeeded(60);
  ASSERT_TRUE(Insert(1001, 500, 1).ok());
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.total, 100u);
  EXPECT_EQ(stats.seed_buffer, 60u);
  EXPECT_EQ(stats.inserted, 500u);
  EXPECT_EQ(stats.evicted, 460u);
  ASSERT_TRUE(Draw(1000, 1000, 0).ok());
  uniform_.ExpectWhole(1000);
  EXPECT_THAT(uniform_.rewards, Each(::testing::AnyOf(Le(60), Ge(1461))));  // the newest 40 of the others
  EXPECT_THAT(plus_.rewards, Each(AllOf(Ge(1461), Le(1500))));
}

TEST_F(BufferWithSeedBuffer, ASeedThatIsNotPinnedGoesFirst) {
  MakeSeeded(60, /*pin=*/false);
  ASSERT_TRUE(Insert(1001, 70, 1).ok());
  EXPECT_EQ(buffer_->Stats().seed_buffer, 30u);
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  EXPECT_THAT(uniform_.rewards, Each(Ge(31)));
  ASSERT_TRUE(Insert(1071, 70, 1).ok());
  EXPECT_EQ(buffer_->Stats().seed_buffer, 0u);
  EXPECT_EQ(buffer_->Stats().seed_buffer_rows, 60u);
  EXPECT_EQ(buffer_->Stats().inserted, 140u);
}

TEST_F(BufferWithSeedBuffer, PartitionsHoldBothKinds) {
  MakeSeeded(10);
  ASSERT_TRUE(Insert(1001, 10, 1).ok());
  Relabel(1, {1, 2, 3, 11}, {1, 1, -1, -1});  // keys 11 to 20 are the others
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.plus, 11u);
  EXPECT_EQ(stats.seed_buffer_plus, 2u);
  EXPECT_EQ(stats.minus, 2u);
  EXPECT_EQ(stats.seed_buffer_minus, 1u);
  EXPECT_EQ(stats.unjudged, 7u);
}

TEST_F(BufferWithSeedBuffer, TheShareOfSeedInADrawIsASetting) {
  buffer_options_.seed_buffer_share.first = 0.25;
  MakeSeeded(60);
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  EXPECT_EQ(SeedBufferAmong(uniform_, 1000, 60), 1000) << "there is nothing else yet";
  ASSERT_TRUE(Insert(1001, 5, 1).ok());
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  EXPECT_EQ(SeedBufferAmong(uniform_, 1000, 60), 250);
  uniform_.ExpectWhole(1000);
  int drawn = 0, of_seed_buffer = 0;  // of draws too small for a whole row of the seed buffer, by chance
  for (; drawn < 1000; ++drawn) {
    ASSERT_TRUE(Draw(1, 0, 0).ok());
    of_seed_buffer += static_cast<int>(SeedBufferAmong(uniform_, 1, 60));
  }
  EXPECT_NEAR(of_seed_buffer, 250, 70);
}

TEST_F(BufferWithSeedBuffer, TheShareHoldsInEachPartThatHasBothKinds) {
  buffer_options_.seed_buffer_share.first = 0.75;
  MakeSeeded(60);
  ASSERT_TRUE(Insert(1001, 30, 1).ok());  // all in D+
  Relabel(1, {1, 2, 3, 4}, {1, -1, -1, -1});
  ASSERT_TRUE(Draw(1000, 1000, 1000).ok());
  EXPECT_EQ(SeedBufferAmong(uniform_, 1000, 60), 750);
  EXPECT_EQ(SeedBufferAmong(plus_, 1000, 60), 750) << "of one row of the seed buffer and 30 others";
  EXPECT_EQ(SeedBufferAmong(minus_, 1000, 60), 1000) << "there is nothing else in D-";
}

TEST_F(BufferWithSeedBuffer, TheShareMayMoveWithTheRowsThatComeIn) {
  buffer_options_.seed_buffer_share = {.first = 1, .final = 0.2, .decay_rows = 40};
  MakeSeeded(60);
  const int shares[] = {1000, 800, 600, 400, 200, 200, 200};  // after 0, 10, 20, ... rows
  for (int i = 1; i <= 6; ++i) {
    ASSERT_TRUE(Insert(static_cast<std::uint64_t>(991 + 10 * i), 10, 1).ok());
    ASSERT_TRUE(Draw(1000, 0, 0).ok());
    EXPECT_NEAR(static_cast<double>(SeedBufferAmong(uniform_, 1000, 60)), shares[i], 1) << i;
  }
  buffer_options_.seed_buffer_share = {.first = 0.5, .final = 0, .decay_rows = 10};
  MakeSeeded(60);
  ASSERT_TRUE(Insert(1001, 10, 1).ok());
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  EXPECT_EQ(SeedBufferAmong(uniform_, 1000, 60), 0) << "0 at the end of a decay is none, not the sizes'";
}

TEST_F(BufferWithSeedBuffer, ADrawMayAskForAShareOfItsOwn) {
  MakeSeeded(60);
  ASSERT_TRUE(Insert(1001, 20, 1).ok());
  const auto draw = [&](double share) {
    const DrawRequest request{
        .counts = {1000, 1000, 0}, .allow_empty_partitions = true, .seed_buffer_share = share};
    ASSERT_TRUE(
        buffer_->Draw(request, {uniform_.columns(), plus_.columns(), minus_.columns()}, kNow, &result_).ok());
  };
  draw(0);
  EXPECT_EQ(SeedBufferAmong(uniform_, 1000, 60), 0) << "none, and not the sizes' share";
  EXPECT_EQ(SeedBufferAmong(plus_, 1000, 60), 0);
  draw(0.5);
  EXPECT_EQ(SeedBufferAmong(uniform_, 1000, 60), 500);
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  EXPECT_NEAR(static_cast<double>(SeedBufferAmong(uniform_, 1000, 60)), 750, 70) << "the options' again";
}

TEST_F(BufferWithSeedBuffer, ADrawMayWaitForTheFirstTransitionsBesideTheSeedBuffer) {
  buffer_options_.limiter = {.samples_per_insert = 2, .tolerance = 20, .min_size = 50};
  MakeSeeded(60);
  const DrawRequest request{.counts = {10, 0, 0}, .first_transitions = 30};
  const auto draw = [&] {
    return buffer_->Draw(request, {uniform_.columns(), plus_.columns(), minus_.columns()}, kNow, &result_);
  };
  EXPECT_TRUE(absl::IsDeadlineExceeded(draw()));
  ASSERT_TRUE(Insert(1001, 29, 1).ok()) << "more than the tolerance lets in where draws are owed";
  EXPECT_TRUE(absl::IsDeadlineExceeded(draw()));
  ASSERT_TRUE(Insert(1030, 1, 1).ok());
  EXPECT_TRUE(draw().ok());
  EXPECT_TRUE(draw().ok());
  EXPECT_TRUE(absl::IsDeadlineExceeded(draw())) << "2 * (30 - 30) + 20 are drawn";
}

TEST_F(BufferWithSeedBuffer, WithoutASettingTheShareIsThatOfTheSizes) {
  MakeSeeded(60);
  ASSERT_TRUE(Insert(1001, 20, 1).ok());
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  EXPECT_NEAR(static_cast<double>(SeedBufferAmong(uniform_, 1000, 60)), 750, 70);
}

TEST_F(BufferWithSeedBuffer, TheLimiterIsIdleUntilTheFirstOnlineRow) {
  buffer_options_.limiter = {.samples_per_insert = 2, .tolerance = 20, .min_size = 50};
  MakeSeeded(60);
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(Draw(40, 0, 0).ok());
  EXPECT_EQ(result_.inserted, 0u);
  EXPECT_EQ(buffer_->Stats().counters.sampled_offline, 4000u);
  ASSERT_TRUE(Insert(1001, 1).ok());
  ASSERT_TRUE(Draw(22, 0, 0).ok());  // 2 * 1 + 20
  EXPECT_THAT(Draw(1, 0, 0).ToString(),
              AllOf(HasSubstr("inserted 1"), HasSubstr("sampled 22"), HasSubstr("seed buffer 60")));
  ASSERT_TRUE(Insert(1002, 21).ok());
  EXPECT_EQ(Insert(1023, 100).code(), absl::StatusCode::kDeadlineExceeded);  // 2 * 22 - 22 is above 20
  const BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.inserted, 22u);
  EXPECT_DOUBLE_EQ(stats.samples_per_insert, 1);
}

TEST_F(BufferWithSeedBuffer, DrawsWaitForTheMinimumSizeOfAllRows) {
  buffer_options_.limiter.min_size = 50;
  Make();
  ASSERT_TRUE(InsertSeedBuffer(1, 40).ok());
  ASSERT_TRUE(buffer_->CompleteSeedBuffer({}, true).ok());
  EXPECT_THAT(Draw(1, 0, 0).ToString(), HasSubstr("10 more transitions"));
  ASSERT_TRUE(Insert(1001, 10).ok());
  EXPECT_TRUE(Draw(1, 0, 0).ok());
}

TEST_F(BufferWithSeedBuffer, ASeedComesFirstOrNotAtAll) {
  Make();
  ASSERT_TRUE(Insert(1, 3).ok());
  EXPECT_THAT(InsertSeedBuffer(1, 1).ToString(), AllOf(HasSubstr("3 others"), HasSubstr("start a new run")));
  MakeSeeded(5);
  EXPECT_EQ(InsertSeedBuffer(6, 1).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(buffer_->CompleteSeedBuffer({}, true).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(buffer_->Stats().seed_buffer_rows, 5u);
}

TEST_F(BufferWithSeedBuffer, ASeedThatHasEveryPlaceLeavesNoneForOthers) {
  Make();
  EXPECT_THAT(InsertSeedBuffer(1, 101).ToString(), AllOf(HasSubstr("100"), HasSubstr("replay.capacity")));
  MakeSeeded(100);
  const absl::Status status = Insert(1001, 1);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(status.ToString(),
              AllOf(HasSubstr("seed buffer of 100"), HasSubstr("replay.seed_buffer.evict")));
  EXPECT_EQ(Relabel(1, {1, 100, 101}, {1, 1, 1}).evicted, 1u);
  EXPECT_TRUE(Draw(10, 10, 0).ok());
}

class StoredSeedBuffer : public BufferWithSeedBuffer {
 protected:
  StoredSeedBuffer() { store_options_.path = absl::StrCat(folder_.path(), "/replay.store"); }
  void Reopen() {
    buffer_.reset();
    store_options_.resume = true;
    Make();
  }
  TestFolder folder_;
};

TEST_F(StoredSeedBuffer, StaysPinnedOverARestart) {
  MakeSeeded(60);
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  ASSERT_TRUE(Insert(1001, 130, 1).ok());
  Relabel(3, {2}, {-1});
  Reopen();
  BufferStats stats = buffer_->Stats();
  EXPECT_EQ(stats.total, 100u);
  EXPECT_EQ(stats.seed_buffer, 60u);
  EXPECT_EQ(stats.seed_buffer_minus, 1u);
  EXPECT_EQ(stats.plus, 40u);
  EXPECT_EQ(stats.inserted, 130u);
  EXPECT_EQ(stats.seed_buffer_record.return_mean, 12.5);
  EXPECT_EQ(stats.counters.sampled_offline, 1000u);
  EXPECT_EQ(InsertSeedBuffer(61, 1).code(), absl::StatusCode::kFailedPrecondition);
  ASSERT_TRUE(Insert(1131, 30, 1).ok());
  ASSERT_TRUE(Draw(1000, 1000, 0).ok());
  uniform_.ExpectWhole(1000);
  EXPECT_THAT(plus_.rewards, Each(AllOf(Ge(1121), Le(1160))));
  EXPECT_EQ(buffer_->Stats().seed_buffer, 60u);
}

TEST_F(StoredSeedBuffer, GoesOnWhereItWasBrokenOff) {
  Make();
  ASSERT_TRUE(InsertSeedBuffer(1, 30).ok());
  Reopen();
  EXPECT_EQ(buffer_->Stats().seed_buffer_rows, 30u);
  EXPECT_EQ(buffer_->Stats().seed_buffer_record.complete, 0u);
  ASSERT_TRUE(InsertSeedBuffer(31, 30).ok());
  ASSERT_TRUE(buffer_->CompleteSeedBuffer({}, true).ok());
  ASSERT_TRUE(Insert(1001, 200, 1).ok());
  EXPECT_EQ(buffer_->Stats().seed_buffer, 60u);
  ASSERT_TRUE(Draw(1000, 0, 0).ok());
  EXPECT_THAT(uniform_.rewards, Each(::testing::AnyOf(Le(60), Ge(1161))));
}

TEST_F(StoredSeedBuffer, ADamagedRowOfAPinnedSeedIsSaid) {
  MakeSeeded(60);
  buffer_.reset();
  const std::string contents = *ReadFile(store_options_.path);
  const std::uint64_t pattern[3] = {33, 33, 0};  // key, sequence and critic version of a row
  const auto place = contents.find(std::string(reinterpret_cast<const char*>(pattern), sizeof pattern));
  ASSERT_NE(place, std::string::npos);
  std::fstream file(store_options_.path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(place));
  file.put(34);
  file.close();
  store_options_.resume = true;
  const absl::Status status = TransitionStore::Open(store_options_).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(status.ToString(), HasSubstr("row 33 of its seed buffer is damaged"));
}

}  // namespace
}  // namespace dbr
