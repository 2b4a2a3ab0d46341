#include "replay/dataset/dataset_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "core/file_io.h"
#include "replay/dataset/hdf5_file.h"
#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::HasSubstr;

constexpr float kDiscount = 0.9f;

int FilesIn(const TempDir& folder) {
  const std::filesystem::directory_iterator files(folder.path());
  return static_cast<int>(std::distance(begin(files), end(files)));
}

TEST(DatasetWriterTest, AnEpisodeThatTheDataCutsShortIsUnfinishedAtTheEndAndCutBefore) {
  const TempDir folder;
  std::vector<TestEpisode> episodes = {MakeEpisode(1, 5, EpisodeEnding::kUnfinished),
                                       MakeEpisode(2, 4, EpisodeEnding::kTerminal),
                                       MakeEpisode(3, 3, EpisodeEnding::kUnfinished)};
  for (const DatasetLayout layout : {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet}) {
    SCOPED_TRACE(DatasetLayoutName(layout));
    WriteWithWriter(folder / "file", episodes, layout);
    const absl::StatusOr<Reading> reading = ReadAll(folder / "file", {.discount = kDiscount});
    ASSERT_TRUE(reading.ok()) << reading.status();
    std::vector<TestEpisode> expected = episodes;
    expected[0].ending = EpisodeEnding::kTimeLimit;
    ExpectSame(*reading, Expected(expected, kDiscount));
  }
}

TEST(DatasetWriterTest, ATerminalInTheLastPossibleStepIsTheLimitsInPybulletFiles) {
  const TempDir folder;
  std::vector<TestEpisode> episodes = {MakeEpisode(1, kTestMaxEpisodeSteps, EpisodeEnding::kTerminal)};
  WriteWithWriter(folder / "d4rl", episodes, DatasetLayout::kD4rl);
  WriteWithWriter(folder / "d4rl_pybullet", episodes, DatasetLayout::kD4rlPybullet);
  EXPECT_EQ(ReadAll(folder / "d4rl", {}).value().facts.terminals, 1);
  EXPECT_EQ(ReadAll(folder / "d4rl_pybullet", {}).value().facts.timeouts, 1);
}

TEST(DatasetWriterTest, WritesTheShiftedRecipe) {
  const TempDir folder;
  const TestEpisode episode = MakeEpisode(1, 2, EpisodeEnding::kTerminal);
  WriteWithWriter(folder / "file", {episode}, DatasetLayout::kD4rlPybullet);
  const absl::StatusOr<Hdf5File> file = Hdf5File::Open(folder / "file");
  ASSERT_TRUE(file.ok()) << file.status();
  std::vector<float> actions(6), rewards(3), terminals(3);
  ASSERT_TRUE(file->Column("actions").value().ReadFloats(0, 3, actions.data()).ok());
  ASSERT_TRUE(file->Column("rewards").value().ReadFloats(0, 3, rewards.data()).ok());
  const std::vector<float> expected_actions = {
      episode.actions[0], episode.actions[1], episode.actions[2], episode.actions[3], 0, 0};
  EXPECT_EQ(actions, expected_actions);
  EXPECT_EQ(rewards, (std::vector<float>{0, episode.rewards[0], episode.rewards[1]}));
  std::vector<std::uint8_t> flags(3);
  ASSERT_TRUE(file->Column("terminals").value().ReadFlags(0, 3, flags.data()).ok());
  EXPECT_EQ(flags, (std::vector<std::uint8_t>{0, 0, 1}));
  EXPECT_EQ(file->Text("layout"), "d4rl_pybullet");
  EXPECT_EQ(file->Text("env"), "test_robot");
}

TEST(DatasetWriterTest, TheSameEpisodesMakeTheSameBytes) {
  const TempDir folder;
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/1, /*steps=*/20000);
  WriteWithWriter(folder / "a", episodes, DatasetLayout::kD4rl);
  WriteWithWriter(folder / "b", episodes, DatasetLayout::kD4rl);
  EXPECT_TRUE(ReadFile(folder / "a").value() == ReadFile(folder / "b").value());
}

TEST(DatasetWriterTest, LeavesNothingUnlessFinished) {
  const TempDir folder;
  {
    auto writer = DatasetWriter::Create(folder / "file", {.env = TestRobot()});
    ASSERT_TRUE(writer.ok()) << writer.status();
    ASSERT_TRUE((*writer)->Append(MakeEpisode(1, 5, EpisodeEnding::kTerminal).View()).ok());
    EXPECT_FALSE(std::filesystem::exists(folder / "file"));
    EXPECT_EQ(FilesIn(folder), 1);
  }
  EXPECT_EQ(FilesIn(folder), 0);
}

TEST(DatasetWriterTest, RefusesWhatItCannotWrite) {
  const TempDir folder;
  const auto refused = [&](const std::string& path, const DatasetWriterOptions& options) {
    return DatasetWriter::Create(path, options).status();
  };
  const absl::Status minari =
      refused(folder / "file", {.layout = DatasetLayout::kMinari, .env = TestRobot()});
  EXPECT_EQ(minari.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(minari.message()), HasSubstr("d4rl or d4rl_pybullet"));
  EnvSpec game = TestRobot();
  game.actions = {ActionKind::kDiscrete, 7};
  EXPECT_EQ(refused(folder / "file", {.env = game}).code(), absl::StatusCode::kInvalidArgument);
  const absl::Status nowhere = refused(folder / "no/such/file", {.env = TestRobot()});
  EXPECT_EQ(nowhere.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(nowhere.message()), HasSubstr("no/such/file"));
  EXPECT_EQ(FilesIn(folder), 0);
}

}  // namespace
}  // namespace dbr
