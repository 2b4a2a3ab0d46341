// What flags say of the ends of episodes: each value is obeyed or makes its row a bad one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kRow = 7;  // in the middle of the first episode

DatasetOptions Options(DatasetLayout layout, bool skip_bad_rows) {
  return {.layout = layout, .max_episode_steps = kTestMaxEpisodeSteps, .skip_bad_rows = skip_bad_rows};
}

// A type of numbers, and flags that it can hold and that mean nothing.
struct FlagType {
  hid_t type;
  std::vector<float> bad;
};

std::vector<FlagType> FlagTypes() {
  return {{H5T_IEEE_F32LE, {kNan, kInfinity, -kInfinity, 2, -1, 0.5, 1e-30f}},
          {H5T_IEEE_F64BE, {kNan, 0.5, -1}},
          {H5T_STD_U8LE, {2, 255}},
          {H5T_STD_I8LE, {-1, 2}},
          {H5T_STD_I32LE, {-1, 2, 256}},
          {H5T_STD_I64BE, {-1, 65536}},
          {H5T_STD_U16LE, {256}}};
}

class DatasetFlagsTest : public testing::Test {
 protected:
  DatasetFlagsTest() : episodes_(MakeEpisodes(/*seed=*/1, /*steps=*/60)) {
    episodes_.insert(episodes_.begin(), MakeEpisode(/*seed=*/2, /*steps=*/10, EpisodeEnding::kTerminal));
  }

  void Write(DatasetLayout layout, const std::string& key, float flag, hid_t type) const {
    if (layout == DatasetLayout::kMinari) return WriteMinariFlag(key, flag, type);
    RawColumns columns = layout == DatasetLayout::kD4rl ? D4rlColumns(episodes_) : PybulletColumns(episodes_);
    columns.timeouts.resize(columns.terminals.size());
    std::vector<float>& flags = key == "terminals" ? columns.terminals : columns.timeouts;
    flags[kRow] = flag;
    WriteRaw(path_, columns, {key});
    RawFile file(path_, RawFile::Opening::kAdd);
    file.Array(key, flags, 0, {.type = type});
  }

  void WriteMinariFlag(const std::string& key, float flag, hid_t type) const {
    WriteMinari(path_, episodes_);
    std::vector<float> flags(static_cast<std::size_t>(episodes_[0].steps()));
    flags[kRow] = flag;
    flags.back() = key == "terminations";
    RawFile file(path_, RawFile::Opening::kAdd);
    file.Remove("episode_0/" + key);
    file.Array("episode_0/" + key, flags, 0, {.type = type});
  }

  // Expects that row kRow is refused, or left out with what leads into it, and that no other episode ends.
  void ExpectABadRow(DatasetLayout layout) const {
    const absl::Status refused = ReadAll(path_, Options(layout, false)).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument) << refused;
    EXPECT_THAT(std::string(refused.message()),
                AllOf(HasSubstr("flags of 0 or 1"), HasSubstr("1 of them a flag"), HasSubstr("row 7 "),
                      HasSubstr("--skip-bad-rows")));
    const absl::StatusOr<Reading> reading = ReadAll(path_, Options(layout, true));
    ASSERT_TRUE(reading.ok()) << reading.status();
    const DatasetFacts expected = Expected(episodes_, 0.99f).facts;
    EXPECT_EQ(reading->facts.bad_rows, 1);
    EXPECT_EQ(reading->facts.bad_flags, 1);
    EXPECT_EQ(reading->facts.episodes, expected.episodes);
    EXPECT_EQ(reading->facts.terminals, expected.terminals);
    const int dropped = layout == DatasetLayout::kD4rl ? 1 : 2;
    EXPECT_EQ(reading->facts.transitions, expected.transitions - dropped);
  }

  const TempDir folder_;
  const std::string path_ = folder_ / "file.hdf5";
  std::vector<TestEpisode> episodes_;
};

TEST_F(DatasetFlagsTest, ARowWhoseFlagIsNeither0Nor1IsBadInEveryLayoutAndType) {
  const std::pair<DatasetLayout, std::string> columns[] = {
      {DatasetLayout::kD4rl, "terminals"},         {DatasetLayout::kD4rl, "timeouts"},
      {DatasetLayout::kD4rlPybullet, "terminals"}, {DatasetLayout::kD4rlPybullet, "timeouts"},
      {DatasetLayout::kMinari, "terminations"},    {DatasetLayout::kMinari, "truncations"}};
  for (const auto& [layout, key] : columns) {
    for (const FlagType& type : FlagTypes()) {
      for (const float flag : type.bad) {
        SCOPED_TRACE(testing::Message() << key << " of " << DatasetLayoutName(layout) << ": " << flag
                                        << " in " << H5Tget_size(type.type) << " bytes");
        Write(layout, key, flag, type.type);
        ExpectABadRow(layout);
      }
    }
  }
}

TEST_F(DatasetFlagsTest, ABadFlagAndABadValueInOneRowMakeOneBadRow) {
  RawColumns columns = D4rlColumns(episodes_);
  columns.terminals[3] = columns.timeouts[3] = 7;
  columns.rewards[3] = kNan;
  columns.rewards[5] = kNan;
  WriteRaw(path_, columns, {});
  const absl::StatusOr<Reading> reading = ReadAll(path_, Options(DatasetLayout::kD4rl, true));
  ASSERT_TRUE(reading.ok()) << reading.status();
  EXPECT_EQ(reading->facts.bad_rows, 2);
  EXPECT_EQ(reading->facts.bad_flags, 1);
}

TEST_F(DatasetFlagsTest, BadFlagsAreCountedAcrossStretches) {
  RawColumns columns = D4rlColumns(MakeEpisodes(/*seed=*/4, /*steps=*/40000));
  for (const int row : {16383, 16384, 32767, 39999}) columns.timeouts[row] = kNan;
  WriteRaw(path_, columns, {"next_observations"});
  EXPECT_THAT(ReadAll(path_, Options(DatasetLayout::kD4rl, false)).status().ToString(),
              AllOf(HasSubstr("in 4 of "), HasSubstr("row 16383 ")));
}

}  // namespace
}  // namespace dbr
