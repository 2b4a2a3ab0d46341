// What Minari writes beside its arrays: folders, names of groups, bounds of actions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <atomic>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr float kDiscount = 0.9f;
const DatasetOptions kMinari = {.layout = DatasetLayout::kMinari, .discount = kDiscount};

std::string Box(const std::string& low, const std::string& high) {
  return absl::StrCat(R"({"type": "Box", "dtype": "float32", "shape": [2], "low": )", low, R"(, "high": )",
                      high, "}");
}

class DatasetMinariTest : public testing::Test {
 protected:
  void SetAttribute(const std::string& name, const std::string& text) const {
    RawFile(path_, RawFile::Opening::kAdd).TextAttribute(name, text);
  }

  std::string Message(const DatasetOptions& options) const {
    const absl::Status status = ReadAll(path_, options).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  }

  // The same episodes before the bounds 1 to 5 and -3 to -1 are brought to [-1, 1].
  static std::vector<TestEpisode> Unscaled(std::vector<TestEpisode> episodes) {
    for (TestEpisode& episode : episodes) {
      for (std::size_t i = 0; i < episode.actions.size(); ++i)
        episode.actions[i] = i % 2 == 0 ? 3 + 2 * episode.actions[i] : episode.actions[i] - 2;
    }
    return episodes;
  }

  void ExpectScaled(const std::string& path) const {
    const absl::StatusOr<Reading> reading = ReadAll(path, kMinari);
    ASSERT_TRUE(reading.ok()) << reading.status();
    const Reading expected = Expected(episodes_, kDiscount);
    ASSERT_EQ(reading->rows.size(), expected.rows.size());
    for (std::size_t row = 0; row < expected.rows.size(); ++row) {
      for (std::size_t i = 0; i < expected.rows[row].size(); ++i)
        ASSERT_NEAR(reading->rows[row][i], expected.rows[row][i], 1e-5) << row << ", " << i;
    }
    EXPECT_EQ(reading->facts.actions_outside, 0);
  }

  const TempDir folder_;
  const std::string path_ = folder_ / "file.hdf5";
  const std::vector<TestEpisode> episodes_ = MakeEpisodes(/*seed=*/1, /*steps=*/100);
};

TEST_F(DatasetMinariTest, NumbersOfEpisodesMayBeginWithZeros) {
  WriteMinari(path_, episodes_);
  {
    RawFile file(path_, RawFile::Opening::kAdd);
    for (std::size_t i = 0; i < episodes_.size(); ++i) {
      const std::string number = std::to_string(i);
      const std::string padded = absl::StrCat("episode_", std::string(4 - number.size(), '0'), number);
      ASSERT_GE(H5Lmove(file.id(), ("episode_" + number).c_str(), H5L_SAME_LOC, padded.c_str(), H5P_DEFAULT,
                        H5P_DEFAULT),
                0);
    }
  }
  const absl::StatusOr<Reading> reading = ReadAll(path_, kMinari);
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes_, kDiscount));
}

TEST_F(DatasetMinariTest, AnEpisodeWithoutANumberIsNotPassedOver) {
  WriteMinari(path_, episodes_);
  RawFile(path_, RawFile::Opening::kAdd).Group("episode_last");
  EXPECT_THAT(Message(kMinari), HasSubstr("'episode_last'"));
}

TEST_F(DatasetMinariTest, AnEpisodeThatIsALinkWithoutATargetIsNamed) {
  WriteMinari(path_, episodes_);
  {
    RawFile file(path_, RawFile::Opening::kAdd);
    file.Remove("episode_1");
    H5Lcreate_external("part2.hdf5", "/episode_1", file.id(), "episode_1", H5P_DEFAULT, H5P_DEFAULT);
  }
  EXPECT_THAT(Message(kMinari),
              HasSubstr("'episode_1' to be a group, found a link to part2.hdf5:/episode_1"));
}

TEST_F(DatasetMinariTest, AFileThatSaysItIsMinarisNeedsNoNamedLayout) {
  WriteMinari(path_, episodes_);
  SetAttribute("minari_version", "0.4.3");
  const absl::StatusOr<Reading> reading = ReadAll(path_, {.discount = kDiscount});
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes_, kDiscount));
  EXPECT_THAT(Message({.layout = DatasetLayout::kD4rl}),
              AllOf(HasSubstr("expected layout d4rl,"), HasSubstr("says minari")));
}

TEST_F(DatasetMinariTest, ActionsAreScaledFromTheBoundsThatTheFileNames) {
  WriteMinari(path_, Unscaled(episodes_));
  SetAttribute("action_space", Box("[1.0, -3.0]", "[5.0, -1.0]"));
  ExpectScaled(path_);
}

TEST_F(DatasetMinariTest, BoundsThatAreOursChangeNoBit) {
  WriteMinari(path_, episodes_);
  SetAttribute("action_space", Box("[-1.0, -1.0]", "[1.0, 1.0]"));
  const absl::StatusOr<Reading> reading = ReadAll(path_, kMinari);
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes_, kDiscount));
}

TEST_F(DatasetMinariTest, SpacesThatCannotBeScaledAreRefusedWithTheReason) {
  const std::pair<std::string, std::string> spaces[] = {
      {R"({"type": "Discrete", "dtype": "int64", "start": 0, "n": 3})", "type \"Discrete\""},
      {Box("[-Infinity, -1.0]", "[Infinity, 1.0]"), "a range without bounds"},
      {Box("[-1.0]", "[1.0]"), "bounds of 1 and 1 numbers"},
      {Box("[-1.0, 1.0]", "[1.0, 1.0]"), "the range 1 to 1"},
      {Box("[NaN, -1.0]", "[1.0, 1.0]"), "found '{"},
      {Box("[[-1.0, -1.0]]", "[[1.0, 1.0]]"), "none that are a list of numbers"},
      {R"({"type": "Box"})", "none that are a list of numbers"},
      {R"({"type": )" + std::string(10'000, '[') + std::string(10'000, ']') + "}", "found '{"},
      {"Box(-1, 1)", "found 'Box(-1, 1)'"}};
  for (const auto& [space, found] : spaces) {
    SCOPED_TRACE(space);
    WriteMinari(path_, episodes_);
    SetAttribute("action_space", space);
    EXPECT_THAT(Message(kMinari), AllOf(HasSubstr("file.hdf5: expected an action space"), HasSubstr(found)));
  }
}

TEST_F(DatasetMinariTest, ADatasetsFolderStandsForItsFileAndMetadata) {
  std::filesystem::create_directories(folder_ / "set/data");
  WriteMinari(folder_ / "set/data/main_data.hdf5", Unscaled(episodes_));
  ASSERT_TRUE(WriteFileAtomically(folder_ / "set/data/metadata.json",
                                  R"({"data_format": "hdf5", "action_space": )"
                                  R"("{\"type\": \"Box\", \"low\": [1, -3], \"high\": [5, -1]}"})")
                  .ok());
  for (const char* path : {"set", "set/", "set/data", "set/data/main_data.hdf5"}) {
    SCOPED_TRACE(path);
    ExpectScaled(folder_ / path);
    EXPECT_TRUE(ReadAll(folder_ / path, {}).ok()) << "the metadata says that it is Minari's";
  }
  ASSERT_TRUE(WriteFileAtomically(folder_ / "set/data/metadata.json", "[1, 2").ok());
  EXPECT_THAT(ReadAll(folder_ / "set", kMinari).status().ToString(),
              AllOf(HasSubstr("metadata.json"), HasSubstr("expected a JSON object")));
}

TEST_F(DatasetMinariTest, AnotherFolderIsRefusedWithWhatWouldDo) {
  EXPECT_THAT(ReadAll(folder_.path(), kMinari).status().ToString(),
              AllOf(HasSubstr(folder_.path()), HasSubstr("data/main_data.hdf5"), HasSubstr("name the file")));
}

TEST_F(DatasetMinariTest, OpeningReadingAndCountingStopWhenTheyAreCancelled) {
  WriteMinari(path_, episodes_);
  std::atomic<bool> cancelled = false;
  DatasetOptions options = kMinari;
  options.cancelled = &cancelled;
  const auto reader = DatasetReader::Open(path_, options);
  ASSERT_TRUE(reader.ok()) << reader.status();
  TransitionChunk chunk((*reader)->transition_layout(), 1000);
  cancelled = true;
  EXPECT_EQ((*reader)->Next(&chunk).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ((*reader)->CountTransitions().status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(DatasetReader::Open(path_, options).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace dbr
