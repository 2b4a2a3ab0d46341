// Keys by which other programs tell where episodes end: each is read as it is meant, or refused by its name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr float kDiscount = 0.9f;

DatasetOptions Options(DatasetLayout layout) {
  return {.layout = layout, .discount = kDiscount, .max_episode_steps = 1000};
}

class DatasetDialectsTest : public testing::Test {
 protected:
  // The columns as d3rlpy 1 writes them: `episode_terminals` marks the last row of each episode, `terminals`
  // those alone where the task ended.
  static std::vector<float> EpisodeEnds(const RawColumns& columns) {
    std::vector<float> ends = columns.terminals;
    for (std::size_t i = 0; i < ends.size(); ++i) ends[i] = std::max(ends[i], columns.timeouts[i]);
    return ends;
  }

  void Add(const std::string& key, const std::vector<float>& values) const {
    RawFile(path_, RawFile::Opening::kAdd).Array(key, values, 0);
  }

  const TempDir folder_;
  const std::string path_ = folder_ / "file.hdf5";
  const std::vector<TestEpisode> episodes_ = MakeEpisodes(/*seed=*/1, /*steps=*/100);
  const RawColumns columns_ = D4rlColumns(episodes_);
};

TEST_F(DatasetDialectsTest, EpisodeTerminalsWithoutATerminalAreCuts) {
  WriteRaw(path_, columns_, {"timeouts"});
  Add("episode_terminals", EpisodeEnds(columns_));
  const absl::StatusOr<Reading> reading = ReadAll(path_, Options(DatasetLayout::kD4rl));
  ASSERT_TRUE(reading.ok()) << reading.status();
  ASSERT_GT(reading->facts.timeouts, 0);
  ExpectSame(*reading, Expected(episodes_, kDiscount));
}

TEST_F(DatasetDialectsTest, EpisodeTerminalsOfArrivalsAreCutsToo) {
  RawColumns columns = PybulletColumns(episodes_);
  const std::vector<float> ends = columns.terminals;
  std::size_t row = 0;
  for (const TestEpisode& episode : episodes_) {
    row += static_cast<std::size_t>(episode.steps()) + 1;
    columns.terminals[row - 1] = episode.ending == EpisodeEnding::kTerminal;
  }
  WriteRaw(path_, columns, {});
  Add("episode_terminals", ends);
  const absl::StatusOr<Reading> reading = ReadAll(path_, Options(DatasetLayout::kD4rlPybullet));
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes_, kDiscount));
}

TEST_F(DatasetDialectsTest, ATerminalAtWhichNoEpisodeEndsMakesABadRow) {
  RawColumns columns = columns_;
  std::vector<float> ends = EpisodeEnds(columns_);
  const auto terminal = std::find(columns.terminals.begin(), columns.terminals.end(), 1.0f);
  ends[static_cast<std::size_t>(terminal - columns.terminals.begin())] = 0;
  WriteRaw(path_, columns, {"timeouts"});
  Add("episode_terminals", ends);
  DatasetOptions options = Options(DatasetLayout::kD4rl);
  options.skip_bad_rows = true;
  const absl::StatusOr<Reading> reading = ReadAll(path_, options);
  ASSERT_TRUE(reading.ok()) << reading.status();
  EXPECT_EQ(reading->facts.bad_flags, 1);
}

TEST_F(DatasetDialectsTest, TimeoutsAndEpisodeTerminalsTogetherAreRefused) {
  WriteRaw(path_, columns_, {});
  Add("episode_terminals", EpisodeEnds(columns_));
  EXPECT_THAT(ReadAll(path_, Options(DatasetLayout::kD4rl)).status().ToString(),
              AllOf(HasSubstr("'timeouts'"), HasSubstr("'episode_terminals'")));
}

TEST_F(DatasetDialectsTest, OtherKeysThatTellOfEndsAreRefusedByName) {
  for (const std::string key :
       {"dones",          "done",        "not_done",    "dones_float",     "done_bools", "truncateds",
        "truncations",    "truncated",   "terminateds", "terminations",    "ends",       "episode_ends",
        "episode_starts", "masks",       "discounts",   "is_first",        "is_last",    "is_terminal",
        "valids",         "episode_ids", "traj_ends",   "episode_lengths", "step_type",  "Dones",
        "EpisodeEnds",    "timeout",     "time_limits", "final_flags"}) {
    for (const DatasetLayout layout : {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet}) {
      WriteRaw(path_, columns_, {});
      Add(key, columns_.terminals);
      const absl::Status status = ReadAll(path_, Options(layout)).status();
      EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
      EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("'" + key + "'"), HasSubstr("'timeouts'")));
    }
  }
}

TEST_F(DatasetDialectsTest, TheyAreRefusedByNameAlsoWhereTerminalsAreMissing) {
  WriteRaw(path_, columns_, {"terminals", "timeouts"});
  Add("dones", columns_.terminals);
  EXPECT_THAT(ReadAll(path_, Options(DatasetLayout::kD4rl)).status().ToString(), HasSubstr("'dones'"));
}

TEST_F(DatasetDialectsTest, AFileOfAnotherLayoutAltogetherIsToldByItsMissingKeys) {
  WriteRaw(path_, columns_, {"observations", "terminals", "timeouts"});
  Add("step_type", columns_.terminals);
  EXPECT_THAT(ReadAll(path_, Options(DatasetLayout::kD4rl)).status().ToString(),
              AllOf(HasSubstr("expected key 'observations', 'terminals'"), HasSubstr("step_type")));
}

TEST_F(DatasetDialectsTest, AMinariEpisodeWithOtherFlagsIsRefusedByName) {
  WriteMinari(path_, episodes_);
  Add("episode_3/dones", {0, 1});
  EXPECT_THAT(ReadAll(path_, Options(DatasetLayout::kMinari)).status().ToString(),
              AllOf(HasSubstr("'episode_3/dones'"), HasSubstr("'truncations'")));
}

TEST_F(DatasetDialectsTest, KeysThatTellOfSomethingElseAreLeftAlone) {
  WriteRaw(path_, columns_, {});
  Add("end_effector_pos", columns_.rewards);
  Add("successes", columns_.terminals);
  {
    RawFile file(path_, RawFile::Opening::kAdd);
    file.Group("infos");
    file.Group("masks");  // a group is no column of flags
  }
  Add("infos/dones", columns_.terminals);
  const absl::StatusOr<Reading> reading = ReadAll(path_, Options(DatasetLayout::kD4rl));
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes_, kDiscount));
}

}  // namespace
}  // namespace dbr
