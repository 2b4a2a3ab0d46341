// What the buffer remembers: episodes, rates, labels, writers, and all of it over a restart.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/replay/buffer/buffer_fixture.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

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
