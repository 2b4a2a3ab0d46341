// How files are stored, how they are streamed, and what bad ones get.
#include "replay/dataset/dataset_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>

#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kDiscount = 0.9f;

DatasetOptions D4rl() {
  return {.layout = DatasetLayout::kD4rl,
          .env = "test_robot",
          .observation_size = kTestObservationSize,
          .action_width = kTestActionWidth,
          .discount = kDiscount,
          .max_episode_steps = kTestMaxEpisodeSteps};
}

class DatasetReaderTest : public testing::Test {
 protected:
  std::string Message(const DatasetOptions& options) {
    const absl::StatusOr<Reading> reading = ReadAll(path_, options);
    EXPECT_FALSE(reading.ok());
    code_ = reading.status().code();
    return std::string(reading.status().message());
  }

  const TempDir folder_;
  const std::string path_ = folder_ / "file.hdf5";
  const std::vector<TestEpisode> episodes_ = MakeEpisodes(/*seed=*/1, /*steps=*/100);
  const RawColumns columns_ = D4rlColumns(episodes_);
  absl::StatusCode code_ = absl::StatusCode::kOk;
};

TEST_F(DatasetReaderTest, ReadsEveryWayOfStoringNumbers) {
  const hid_t boolean = H5Tenum_create(H5T_STD_I8LE);
  const std::int8_t no = 0, yes = 1;
  H5Tenum_insert(boolean, "FALSE", &no);
  H5Tenum_insert(boolean, "TRUE", &yes);
  const RawFile::Storage numbers[] = {{.type = H5T_IEEE_F32LE},
                                      {.type = H5T_IEEE_F64LE},
                                      {.type = H5T_IEEE_F32BE},
                                      {.type = H5T_IEEE_F32LE, .chunk_rows = 7},
                                      {.type = H5T_IEEE_F64LE, .chunk_rows = 64, .gzip = 6}};
  for (const RawFile::Storage& storage : numbers) {
    for (const hid_t flag_type : {H5T_STD_U8LE, H5T_STD_I8LE, H5T_STD_I32LE, H5T_IEEE_F32LE, boolean}) {
      {
        RawFile file(path_);
        file.Array("observations", columns_.observations, kTestObservationSize, storage);
        file.Array("next_observations", columns_.next_observations, kTestObservationSize, storage);
        file.Array("actions", columns_.actions, kTestActionWidth, storage);
        file.Array("rewards", columns_.rewards, /*width=*/1, storage);
        file.Array("terminals", columns_.terminals, 0, {.type = flag_type});
        file.Array("timeouts", columns_.timeouts, 0, {.type = flag_type});
      }
      const absl::StatusOr<Reading> reading = ReadAll(path_, D4rl());
      ASSERT_TRUE(reading.ok()) << reading.status();
      ExpectSame(*reading, Expected(episodes_, kDiscount));
    }
  }
  H5Tclose(boolean);
}

TEST_F(DatasetReaderTest, ChunksOfAnySizeGiveTheSameStream) {
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/2, /*steps=*/40000);
  const Reading expected = Expected(episodes, kDiscount);
  for (const DatasetLayout layout : {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet}) {
    WriteWithWriter(path_, episodes, layout);
    for (const int chunk : {1, 7, 4096, 100000}) {
      SCOPED_TRACE(chunk);
      const absl::StatusOr<Reading> reading = ReadAll(path_, {.discount = kDiscount}, chunk);
      ASSERT_TRUE(reading.ok()) << reading.status();
      ExpectSame(*reading, expected);
    }
  }
}

TEST_F(DatasetReaderTest, ChunksOfAnySizeGiveTheSameStreamWhereRowsAreDropped) {
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/3, /*steps=*/40000);
  WriteRaw(path_, D4rlColumns(episodes), {"next_observations", "timeouts"});
  const absl::StatusOr<Reading> expected = ReadAll(path_, D4rl(), 1000000);
  ASSERT_TRUE(expected.ok()) << expected.status();
  EXPECT_EQ(expected->facts.transitions, expected->facts.rows - expected->facts.timeouts);
  EXPECT_EQ(expected->facts.episodes, static_cast<std::int64_t>(episodes.size()));
  for (const int chunk : {1, 7, 4096}) {
    SCOPED_TRACE(chunk);
    const absl::StatusOr<Reading> reading = ReadAll(path_, D4rl(), chunk);
    ASSERT_TRUE(reading.ok()) << reading.status();
    ExpectSame(*reading, *expected);
  }
}

TEST_F(DatasetReaderTest, CountsTransitionsWithoutMovingTheStream) {
  for (const bool with_next : {true, false}) {
    WriteRaw(path_, columns_,
             with_next ? std::vector<std::string>() : std::vector<std::string>{"next_observations"});
    const auto reader = DatasetReader::Open(path_, D4rl());
    ASSERT_TRUE(reader.ok()) << reader.status();
    TransitionChunk chunk((*reader)->transition_layout(), 10);
    ASSERT_EQ((*reader)->Next(&chunk).value(), 10);
    const absl::StatusOr<std::int64_t> counted = (*reader)->CountTransitions();
    ASSERT_TRUE(counted.ok()) << counted.status();
    while ((*reader)->Next(&chunk).value() > 0) {
    }
    EXPECT_EQ(*counted, (*reader)->facts().transitions);
    EXPECT_EQ((*reader)->Next(&chunk).value(), 0);
  }
}

TEST_F(DatasetReaderTest, AnEmptyFileHasNoTransitions) {
  RawFile::Storage storage;
  {
    RawFile file(path_);
    file.Array("observations", {}, kTestObservationSize, storage);
    file.Array("actions", {}, kTestActionWidth, storage);
    file.Array("rewards", {}, 0, storage);
    file.Array("terminals", {}, 0, storage);
  }
  const absl::StatusOr<Reading> reading = ReadAll(path_, D4rl());
  ASSERT_TRUE(reading.ok()) << reading.status();
  EXPECT_EQ(reading->facts.rows, 0);
  EXPECT_TRUE(reading->rows.empty());
  EXPECT_TRUE(std::isnan(reading->facts.return_mean));
}

TEST_F(DatasetReaderTest, RefusesAnUnnamedLayout) {
  WriteRaw(path_, columns_, {});
  EXPECT_THAT(Message({}), AllOf(HasSubstr("d4rl, d4rl_pybullet or minari"), HasSubstr("file.hdf5")));
  EXPECT_EQ(code_, absl::StatusCode::kInvalidArgument);
}

TEST_F(DatasetReaderTest, TakesTheLayoutFromTheFileAndRefusesAContradiction) {
  for (const std::string name : {"d4rl", "d4rl_pybullet", "rlds"}) {
    WriteRaw(path_, columns_, {});
    const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(file, 0);
    const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    H5Tset_size(type, name.size());
    const hid_t attribute = H5Acreate2(file, "layout", type, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, type, name.c_str());
    H5Aclose(attribute);
    H5Sclose(space);
    H5Tclose(type);
    H5Fclose(file);
    if (name == "d4rl") {
      EXPECT_TRUE(ReadAll(path_, {}).ok());
      EXPECT_TRUE(ReadAll(path_, D4rl()).ok());
    } else if (name == "d4rl_pybullet") {
      EXPECT_THAT(Message(D4rl()),
                  AllOf(HasSubstr("expected layout d4rl,"), HasSubstr("says d4rl_pybullet")));
    } else {
      EXPECT_THAT(Message(D4rl()), HasSubstr("unknown layout 'rlds'"));
    }
  }
}

TEST_F(DatasetReaderTest, NamesAllMissingKeysAndThoseThatAreThere) {
  WriteRaw(path_, columns_, {"rewards", "terminals"});
  EXPECT_THAT(Message(D4rl()), AllOf(HasSubstr("'rewards', 'terminals'"),
                                     HasSubstr("actions, next_observations, observations, timeouts")));
  DatasetOptions minari = D4rl();
  minari.layout = DatasetLayout::kMinari;
  EXPECT_THAT(Message(minari), AllOf(HasSubstr("episode_0"), HasSubstr("observations")));
}

TEST_F(DatasetReaderTest, NamesTheMissingArraysOfAMinariEpisode) {
  {
    RawFile file(path_);
    file.Group("episode_0");
    file.Array("episode_0/observations", {1, 2, 3, 4, 5, 6}, 3);
    file.Array("episode_0/actions", {1, 2}, 2);
  }
  DatasetOptions minari = D4rl();
  minari.layout = DatasetLayout::kMinari;
  EXPECT_THAT(Message(minari),
              AllOf(HasSubstr("'episode_0'"), HasSubstr("'rewards', 'terminations', 'truncations'")));
}

TEST_F(DatasetReaderTest, RefusesArraysOfDifferentLengthsWithBothNumbers) {
  for (const std::string key : {"actions", "rewards", "terminals", "timeouts", "next_observations"}) {
    RawColumns columns = columns_;
    std::vector<float>& shortened = key == "actions"     ? columns.actions
                                    : key == "rewards"   ? columns.rewards
                                    : key == "terminals" ? columns.terminals
                                    : key == "timeouts"  ? columns.timeouts
                                                         : columns.next_observations;
    shortened.resize(shortened.size() - 6);
    const int width = key == "actions"             ? kTestActionWidth
                      : key == "next_observations" ? kTestObservationSize
                                                   : 1;
    WriteRaw(path_, columns, {});
    const std::size_t rows = columns_.rewards.size();
    EXPECT_THAT(Message(D4rl()), AllOf(HasSubstr(std::to_string(rows) + " rows of 'observations'"),
                                       HasSubstr(std::to_string(rows - 6 / width) + " of '" + key + "'")));
    EXPECT_EQ(code_, absl::StatusCode::kInvalidArgument);
  }
}

TEST_F(DatasetReaderTest, RefusesAMinariEpisodeWithoutItsLastObservation) {
  std::vector<TestEpisode> episodes = episodes_;
  episodes[2].observations.resize(episodes[2].observations.size() - kTestObservationSize);
  WriteMinari(path_, episodes);
  DatasetOptions minari = D4rl();
  minari.layout = DatasetLayout::kMinari;
  EXPECT_THAT(Message(minari), AllOf(HasSubstr("one row more of observations"), HasSubstr("'episode_2'")));
}

TEST_F(DatasetReaderTest, RefusesAnotherRobotsSizes) {
  WriteRaw(path_, columns_, {});
  DatasetOptions options = D4rl();
  options.observation_size = 15;
  EXPECT_THAT(Message(options), AllOf(HasSubstr("expected observations of 15 and actions of 2"),
                                      HasSubstr("(test_robot)"), HasSubstr("found 3 and 2")));
  options = D4rl();
  options.action_width = 8;
  EXPECT_THAT(Message(options), HasSubstr("actions of 8"));
}

TEST_F(DatasetReaderTest, RefusesWhatIsNoArrayOfNumbers) {
  {
    RawFile file(path_);
    file.Group("observations");
    file.Array("actions", columns_.actions, kTestActionWidth);
    file.Array("rewards", columns_.rewards, 0);
    file.Array("terminals", columns_.terminals, 0);
  }
  EXPECT_THAT(Message(D4rl()), HasSubstr("expected 'observations' to be an array of numbers"));
  RawColumns columns = columns_;
  columns.rewards.insert(columns.rewards.end(), columns_.rewards.begin(), columns_.rewards.end());
  {
    RawFile file(path_);
    file.Array("observations", columns.observations, kTestObservationSize);
    file.Array("actions", columns.actions, kTestActionWidth);
    file.Array("rewards", columns.rewards, 2);
    file.Array("terminals", columns.terminals, 0);
  }
  EXPECT_THAT(Message(D4rl()), HasSubstr("expected one number a row in 'rewards', found 2"));
}

TEST_F(DatasetReaderTest, NamesAndCountsRowsThatAreNotFinite) {
  RawColumns columns = columns_;
  columns.rewards[60] = kNan;
  columns.observations[40 * kTestObservationSize + 1] = kInfinity;
  columns.actions[40 * kTestActionWidth] = kNan;
  columns.next_observations[70 * kTestObservationSize] = -kInfinity;
  WriteRaw(path_, columns, {});
  EXPECT_THAT(Message(D4rl()),
              AllOf(HasSubstr("in 3 of "), HasSubstr("row 40 "), HasSubstr("--skip-bad-rows")));
  EXPECT_EQ(code_, absl::StatusCode::kInvalidArgument);

  DatasetOptions options = D4rl();
  options.skip_bad_rows = true;
  const absl::StatusOr<Reading> reading = ReadAll(path_, options);
  ASSERT_TRUE(reading.ok()) << reading.status();
  Reading expected = Expected(episodes_, kDiscount);
  for (const int row : {70, 60, 40}) expected.rows.erase(expected.rows.begin() + row);
  EXPECT_EQ(reading->rows, expected.rows);
  EXPECT_EQ(reading->facts.bad_rows, 3);
  EXPECT_EQ(reading->facts.transitions, static_cast<std::int64_t>(expected.rows.size()));
  EXPECT_TRUE(std::isfinite(reading->facts.return_mean));
}

TEST_F(DatasetReaderTest, ABadRowTakesTheTransitionsThatLeadIntoItAlong) {
  const std::vector<TestEpisode> episodes = {MakeEpisode(5, 6, EpisodeEnding::kTerminal),
                                             MakeEpisode(6, 4, EpisodeEnding::kTerminal)};
  RawColumns columns = PybulletColumns(episodes);
  columns.observations[3 * kTestObservationSize] = kNan;
  WriteRaw(path_, columns, {});
  DatasetOptions options = D4rl();
  options.layout = DatasetLayout::kD4rlPybullet;
  EXPECT_THAT(Message(options), HasSubstr("in 1 of 12 rows"));
  options.skip_bad_rows = true;
  const absl::StatusOr<Reading> reading = ReadAll(path_, options);
  ASSERT_TRUE(reading.ok()) << reading.status();
  Reading expected = Expected(episodes, kDiscount);
  expected.rows.erase(expected.rows.begin() + 2, expected.rows.begin() + 4);
  EXPECT_EQ(reading->rows, expected.rows);
  EXPECT_EQ(reading->facts.episodes, 2);
  EXPECT_NEAR(reading->facts.return_mean, episodes[1].Return(), 1e-9);  // the other one's is not known
  ASSERT_EQ(reading->ended.size(), 1);
  EXPECT_EQ(reading->ended[0].index, 7);
}

TEST_F(DatasetReaderTest, CountsBadRowsFarBehindTheFirstAndAcrossStretches) {
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/4, /*steps=*/40000);
  RawColumns columns = D4rlColumns(episodes);
  for (const int row : {16383, 16384, 32767, 39999}) columns.rewards[row] = kNan;
  WriteRaw(path_, columns, {});
  EXPECT_THAT(Message(D4rl()), AllOf(HasSubstr("in 4 of "), HasSubstr("row 16383 ")));
}

TEST_F(DatasetReaderTest, CountsABadFinalObservationOfMinariOnce) {
  std::vector<TestEpisode> episodes = episodes_;
  episodes[0].observations.back() = kNan;
  WriteMinari(path_, episodes);
  DatasetOptions minari = D4rl();
  minari.layout = DatasetLayout::kMinari;
  EXPECT_THAT(Message(minari), AllOf(HasSubstr("in 1 of "),
                                     HasSubstr("row " + std::to_string(episodes[0].steps() - 1) + " ")));
}

TEST_F(DatasetReaderTest, CountsRowsWithActionsOutsideTheRangeInEveryLayout) {
  std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/5, /*steps=*/40000);
  episodes[0].actions[0] = -7;  // two values of one row
  episodes[0].actions[1] = 1.25;
  episodes[1].actions[0] = 1 + 1e-6f;  // what rounding does
  episodes[2].actions[0] = kInfinity;  // a bad row
  episodes.back().actions.back() = -1.001f;
  WriteRaw(folder_ / "d4rl", D4rlColumns(episodes), {});
  WriteRaw(folder_ / "d4rl_pybullet", PybulletColumns(episodes), {});
  WriteMinari(folder_ / "minari", episodes);
  for (const DatasetLayout layout :
       {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet, DatasetLayout::kMinari}) {
    SCOPED_TRACE(DatasetLayoutName(layout));
    const absl::StatusOr<Reading> reading =
        ReadAll(folder_ / DatasetLayoutName(layout), {.layout = layout, .skip_bad_rows = true}, 4096);
    ASSERT_TRUE(reading.ok()) << reading.status();
    EXPECT_EQ(reading->facts.actions_outside, 2);
    EXPECT_EQ(reading->facts.bad_rows, 1);
  }
}

TEST_F(DatasetReaderTest, GivesTheSameErrorAgain) {
  RawColumns columns = columns_;
  columns.rewards[0] = kNan;
  WriteRaw(path_, columns, {});
  const auto reader = DatasetReader::Open(path_, D4rl());
  ASSERT_TRUE(reader.ok()) << reader.status();
  TransitionChunk chunk((*reader)->transition_layout(), 10);
  const absl::Status first = (*reader)->Next(&chunk).status();
  EXPECT_FALSE(first.ok());
  EXPECT_EQ((*reader)->Next(&chunk).status(), first);
}

TEST_F(DatasetReaderTest, RefusesTruncatedFiles) {
  WriteWithWriter(path_, MakeEpisodes(/*seed=*/7, /*steps=*/30000), DatasetLayout::kD4rl);
  const auto whole = static_cast<std::int64_t>(std::filesystem::file_size(path_));
  for (const std::int64_t size : {whole - 1, whole / 2, std::int64_t{600}, std::int64_t{100}}) {
    std::filesystem::resize_file(path_, size);
    EXPECT_THAT(Message(D4rl()), HasSubstr("file.hdf5"));
    EXPECT_EQ(code_, absl::StatusCode::kDataLoss) << size;
  }
}

TEST_F(DatasetReaderTest, RefusesFilesWithDamagedRows) {
  WriteRaw(path_, D4rlColumns(MakeEpisodes(/*seed=*/7, /*steps=*/3000)), {}, {.chunk_rows = 500, .gzip = 1});
  const auto size = static_cast<std::int64_t>(std::filesystem::file_size(path_));
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  for (std::int64_t at = 4096; at + 64 < size; at += 512) {
    file.seekp(at);
    file.write("damaged by a disk", 17);
  }
  file.close();
  Message(D4rl());
  EXPECT_TRUE(code_ == absl::StatusCode::kDataLoss || code_ == absl::StatusCode::kInvalidArgument);
}

TEST_F(DatasetReaderTest, SaysWhatIsNoHdf5FileOrNotThere) {
  std::ofstream(path_) << "observations,actions,rewards\n1,2,3\n";
  EXPECT_THAT(Message(D4rl()), HasSubstr("expected an HDF5 file"));
  EXPECT_EQ(code_, absl::StatusCode::kDataLoss);
  std::filesystem::remove(path_);
  EXPECT_THAT(Message(D4rl()), HasSubstr("file.hdf5"));
  EXPECT_EQ(code_, absl::StatusCode::kNotFound);
  EXPECT_FALSE(ReadAll(folder_.path(), D4rl()).ok());
}

TEST_F(DatasetReaderTest, ErrorsStayOffTheScreen) {
  WriteRaw(path_, columns_, {"rewards"});
  testing::internal::CaptureStderr();
  Message(D4rl());
  std::ofstream(path_) << "no HDF5";
  Message(D4rl());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace dbr
