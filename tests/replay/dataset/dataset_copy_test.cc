#include "replay/dataset/dataset_copy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

constexpr float kDiscount = 0.9f;

absl::Status Copy(const std::string& from, const DatasetOptions& options, const std::string& to,
                  DatasetLayout layout) {
  auto reader = DatasetReader::Open(from, options);
  if (!reader.ok()) return reader.status();
  auto writer = DatasetWriter::Create(to, {.layout = layout, .env = TestRobot()});
  if (!writer.ok()) return writer.status();
  const absl::Status copied = CopyDataset(reader->get(), writer->get(), [](std::int64_t) { return true; });
  if (!copied.ok()) return copied;
  return (*writer)->Finish();
}

TEST(DatasetCopyTest, EveryLayoutBecomesEveryOtherWithoutLoss) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/1, /*steps=*/6000);
  WriteWithWriter(folder / "d4rl", episodes, DatasetLayout::kD4rl);
  WriteWithWriter(folder / "d4rl_pybullet", episodes, DatasetLayout::kD4rlPybullet);
  WriteMinari(folder / "minari", episodes);
  for (const DatasetLayout from :
       {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet, DatasetLayout::kMinari}) {
    for (const DatasetLayout to : {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet}) {
      SCOPED_TRACE(DatasetLayoutName(from) + " to " + DatasetLayoutName(to));
      const absl::Status copied =
          Copy(folder / DatasetLayoutName(from), {.layout = from}, folder / "copy", to);
      ASSERT_TRUE(copied.ok()) << copied;
      const absl::StatusOr<Reading> reading = ReadAll(folder / "copy", {.discount = kDiscount});
      ASSERT_TRUE(reading.ok()) << reading.status();
      ExpectSame(*reading, Expected(episodes, kDiscount));
    }
  }
}

TEST(DatasetCopyTest, EpisodesWithoutTheirLastObservationStayCut) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = {MakeEpisode(1, kTestMaxEpisodeSteps, EpisodeEnding::kTimeLimit),
                                             MakeEpisode(2, 5, EpisodeEnding::kTerminal)};
  WriteRaw(folder / "file", D4rlColumns(episodes), {"next_observations"});
  const absl::Status copied =
      Copy(folder / "file", {.layout = DatasetLayout::kD4rl}, folder / "copy", DatasetLayout::kD4rlPybullet);
  ASSERT_TRUE(copied.ok()) << copied;
  const absl::StatusOr<Reading> reading = ReadAll(folder / "copy", {});
  ASSERT_TRUE(reading.ok()) << reading.status();
  EXPECT_EQ(reading->facts.transitions, kTestMaxEpisodeSteps - 1 + 5);
  EXPECT_EQ(reading->facts.timeouts, 1);
  EXPECT_EQ(reading->facts.terminals, 1);
}

TEST(DatasetCopyTest, GapsNeverJoinWhatDoesNotBelongTogether) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = {MakeEpisode(1, 8, EpisodeEnding::kTerminal),
                                             MakeEpisode(2, 5, EpisodeEnding::kTerminal)};
  RawColumns columns = D4rlColumns(episodes);
  columns.rewards[3] = std::numeric_limits<float>::quiet_NaN();
  WriteRaw(folder / "file", columns, {});
  const DatasetOptions options = {
      .layout = DatasetLayout::kD4rl, .discount = kDiscount, .skip_bad_rows = true};
  const absl::StatusOr<Reading> before = ReadAll(folder / "file", options);
  ASSERT_TRUE(before.ok()) << before.status();
  for (const DatasetLayout layout : {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet}) {
    const absl::Status copied = Copy(folder / "file", options, folder / "copy", layout);
    ASSERT_TRUE(copied.ok()) << copied;
    const absl::StatusOr<Reading> after = ReadAll(folder / "copy", {.discount = kDiscount});
    ASSERT_TRUE(after.ok()) << after.status();
    EXPECT_EQ(after->rows, before->rows);
    EXPECT_EQ(after->facts.terminals, 2);
    EXPECT_EQ(after->facts.timeouts, 1);  // the piece before the gap
  }
}

TEST(DatasetCopyTest, StopsWhenAsked) {
  const TempDir folder;
  WriteWithWriter(folder / "file", MakeEpisodes(/*seed=*/1, /*steps=*/9000), DatasetLayout::kD4rl);
  auto reader = DatasetReader::Open(folder / "file", {});
  auto writer = DatasetWriter::Create(folder / "copy", {.env = TestRobot()});
  ASSERT_TRUE(reader.ok() && writer.ok());
  const absl::Status copied =
      CopyDataset(reader->get(), writer->get(), [](std::int64_t transitions) { return transitions < 5000; });
  EXPECT_EQ(copied.code(), absl::StatusCode::kCancelled);
  EXPECT_LT((*reader)->facts().transitions, 9000);
}

}  // namespace
}  // namespace dbr
