// What the layouts mean: the same episodes give the same transitions, however they lie in the file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

constexpr float kDiscount = 0.9f;

DatasetOptions Options(DatasetLayout layout) {
  return {.layout = layout,
          .observation_size = kTestObservationSize,
          .action_width = kTestActionWidth,
          .discount = kDiscount,
          .max_episode_steps = kTestMaxEpisodeSteps};
}

TEST(DatasetLayoutTest, SameEpisodesGiveSameTransitionsInEveryLayout) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/1, /*steps=*/400);
  const Reading expected = Expected(episodes, kDiscount);
  ASSERT_GT(expected.facts.timeouts, 0);
  ASSERT_GT(expected.facts.terminals, 0);
  WriteRaw(folder / "d4rl", D4rlColumns(episodes), {});
  WriteRaw(folder / "d4rl_pybullet", PybulletColumns(episodes), {});
  WriteMinari(folder / "minari", episodes);
  for (const DatasetLayout layout :
       {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet, DatasetLayout::kMinari}) {
    SCOPED_TRACE(DatasetLayoutName(layout));
    const absl::StatusOr<Reading> reading = ReadAll(folder / DatasetLayoutName(layout), Options(layout));
    ASSERT_TRUE(reading.ok()) << reading.status();
    ExpectSame(*reading, expected);
    const std::int64_t arrivals = layout == DatasetLayout::kD4rlPybullet ? expected.facts.episodes : 0;
    EXPECT_EQ(reading->facts.rows, expected.facts.transitions + arrivals);
  }
}

TEST(DatasetLayoutTest, RoundTripsThroughTheWriterInBothLayouts) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/2, /*steps=*/30000);
  const Reading expected = Expected(episodes, kDiscount);
  for (const DatasetLayout layout : {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet}) {
    SCOPED_TRACE(DatasetLayoutName(layout));
    WriteWithWriter(folder / "file", episodes, layout);
    // Layout and length of an episode are the file's own attributes.
    const absl::StatusOr<Reading> reading = ReadAll(folder / "file", {.discount = kDiscount});
    ASSERT_TRUE(reading.ok()) << reading.status();
    ExpectSame(*reading, expected);
  }
}

TEST(DatasetLayoutTest, AFileReadInTheOtherLayoutHasRewardsOfOtherActions) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = {MakeEpisode(/*seed=*/3, 4, EpisodeEnding::kTerminal)};
  WriteRaw(folder / "file", PybulletColumns(episodes), {});
  const absl::StatusOr<Reading> right = ReadAll(folder / "file", Options(DatasetLayout::kD4rlPybullet));
  const absl::StatusOr<Reading> wrong = ReadAll(folder / "file", Options(DatasetLayout::kD4rl));
  ASSERT_TRUE(right.ok() && wrong.ok());
  const int reward = kTestObservationSize + kTestActionWidth;
  EXPECT_EQ(right->rows[0][reward], episodes[0].rewards[0]);
  EXPECT_EQ(wrong->rows[1][reward], episodes[0].rewards[0]);
}

TEST(DatasetLayoutTest, D4rlWithoutNextObservationsTakesTheNextRowAndDropsWhatHasNone) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = {
      MakeEpisode(4, 5, EpisodeEnding::kTerminal), MakeEpisode(5, 6, EpisodeEnding::kTimeLimit),
      MakeEpisode(6, 1, EpisodeEnding::kTimeLimit), MakeEpisode(7, 3, EpisodeEnding::kUnfinished)};
  WriteRaw(folder / "file", D4rlColumns(episodes), {"next_observations"});
  const absl::StatusOr<Reading> reading = ReadAll(folder / "file", Options(DatasetLayout::kD4rl));
  ASSERT_TRUE(reading.ok()) << reading.status();

  Reading expected = Expected(episodes, kDiscount);
  // A terminal has no future: any next observation will do, and its own is at hand.
  const std::size_t last_of_first = 4;
  std::copy_n(expected.rows[last_of_first].begin(), kTestObservationSize,
              expected.rows[last_of_first].end() - kTestObservationSize);
  for (const std::size_t dropped : {14, 11, 10}) expected.rows.erase(expected.rows.begin() + dropped);
  EXPECT_EQ(reading->rows, expected.rows);
  EXPECT_EQ(reading->facts.rows, 15);
  EXPECT_EQ(reading->facts.transitions, 12);
  EXPECT_EQ(reading->facts.episodes, 3);
  EXPECT_EQ(reading->facts.timeouts, 2);
  EXPECT_NEAR(reading->facts.return_mean, expected.facts.return_mean, 1e-9);
  // The cut episode's end goes with its last transition and counts all its rewards.
  ASSERT_EQ(reading->ended.size(), 2);
  EXPECT_EQ(reading->ended[1].index, 9);
  EXPECT_EQ(reading->ended[1].end.length, 6);
  EXPECT_NEAR(reading->ended[1].end.episode_return, episodes[1].Return(), 1e-5);
}

TEST(DatasetLayoutTest, D4rlWithoutTimeoutsCutsEpisodesAsLongAsTheLimit) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/8, /*steps=*/300);
  WriteRaw(folder / "file", D4rlColumns(episodes), {"timeouts"});
  const absl::StatusOr<Reading> reading = ReadAll(folder / "file", Options(DatasetLayout::kD4rl));
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes, kDiscount));
}

TEST(DatasetLayoutTest, PybulletEpisodesOfExactlyTheLimitAreCutAndShorterOnesTerminal) {
  const TempDir folder;
  std::vector<TestEpisode> episodes = {MakeEpisode(9, kTestMaxEpisodeSteps, EpisodeEnding::kTimeLimit),
                                       MakeEpisode(10, kTestMaxEpisodeSteps - 1, EpisodeEnding::kTerminal)};
  WriteRaw(folder / "file", PybulletColumns(episodes), {});
  absl::StatusOr<Reading> reading = ReadAll(folder / "file", Options(DatasetLayout::kD4rlPybullet));
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes, kDiscount));
  // The limit is 1,000 where neither the caller nor the file names another.
  reading = ReadAll(folder / "file", {.layout = DatasetLayout::kD4rlPybullet, .discount = kDiscount});
  ASSERT_TRUE(reading.ok()) << reading.status();
  episodes[0].ending = EpisodeEnding::kTerminal;
  ExpectSame(*reading, Expected(episodes, kDiscount));
}

TEST(DatasetLayoutTest, MinariEpisodesWithoutAFlagEndWithTheirGroupAsCut) {
  const TempDir folder;
  std::vector<TestEpisode> episodes = {MakeEpisode(11, 5, EpisodeEnding::kUnfinished),
                                       MakeEpisode(12, 3, EpisodeEnding::kTerminal)};
  WriteMinari(folder / "file", episodes);
  const absl::StatusOr<Reading> reading = ReadAll(folder / "file", Options(DatasetLayout::kMinari));
  ASSERT_TRUE(reading.ok()) << reading.status();
  episodes[0].ending = EpisodeEnding::kTimeLimit;
  ExpectSame(*reading, Expected(episodes, kDiscount));
}

TEST(DatasetLayoutTest, MinariEpisodesComeInTheOrderOfTheirNumbers) {
  const TempDir folder;
  std::vector<TestEpisode> episodes;
  for (int i = 0; i < 12; ++i) episodes.push_back(MakeEpisode(20 + i, 2, EpisodeEnding::kTerminal));
  WriteMinari(folder / "file", episodes);  // "episode_10" sorts before "episode_2" as text
  const absl::StatusOr<Reading> reading = ReadAll(folder / "file", Options(DatasetLayout::kMinari));
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes, kDiscount));
}

}  // namespace
}  // namespace dbr
