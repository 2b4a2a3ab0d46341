// What is done with a cell, by what stands in its folder.
#include "deploy/experiment/cell.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "core/file_io.h"
#include "core/run_folder.h"
#include "deploy/launch/results.h"
#include "deploy/launch/run_plan.h"
#include "proto/config/config_file.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class CellTest : public testing::Test {
 protected:
  CellTest() {
    cell_.task = "connect4";
    cell_.contender = "dbr";
    cell_.folder = folder_ / cell_.name();
    cell_.config.mutable_replay()->set_capacity(5000);
    cell_.config.mutable_launch()->set_max_episodes(10);
  }

  // A run of `config` whose last launch ended so, its store still there.
  void MakeRun(const Config& config, RunEnding ended, bool with_results = false) {
    std::filesystem::create_directories(run().checkpoints());
    std::filesystem::create_directories(run().policies());
    for (const auto& [path, contents] :
         {std::pair(run().config(), PrintConfig(config)), std::pair(run().replay_store(), std::string("D")),
          std::pair(run().latest_policy(), std::string("pi")),
          std::pair(run().checkpoints() + "/7.safetensors", std::string("x"))})
      ASSERT_TRUE(WriteFileAtomically(path, contents).ok());
    RunSummary summary;
    summary.ended = ended;
    summary.launches = 3;
    summary.wall_s = 12;
    if (with_results) {
      summary.final_results = {{.env = "connect4", .opponent = "random", .score_mean = 0.987},
                               {.env = "connect4", .opponent = "mcts:10", .score_mean = 0.5}};
    }
    ASSERT_TRUE(WriteSummary(summary, run()).ok());
  }

  RunFolder run() const { return {cell_.folder}; }
  CellState State() const { return ReadStanding(cell_).state; }

  const TempDir folder_;
  Cell cell_;
};

TEST_F(CellTest, WithoutAFolderIsNew) {
  EXPECT_EQ(State(), CellState::kNew);
}

TEST_F(CellTest, AtItsLimitWithFinalResultsIsDone) {
  MakeRun(cell_.config, RunEnding::kMaxEpisodes, /*with_results=*/true);
  const CellStanding standing = ReadStanding(cell_);
  EXPECT_EQ(standing.state, CellState::kDone);
  EXPECT_EQ(standing.summary.wall_s, 12);
  EXPECT_EQ(ResultText(standing.summary), "random 0.99, mcts:10 0.50");
}

TEST_F(CellTest, AtItsLimitWithoutFinalResultsGoesOn) {
  MakeRun(cell_.config, RunEnding::kMaxEpisodes);
  EXPECT_EQ(State(), CellState::kInterrupted) << "it was stopped in the final evaluation";
}

TEST_F(CellTest, StoppedOrKilledGoesOn) {
  MakeRun(cell_.config, RunEnding::kInterrupted);
  EXPECT_EQ(State(), CellState::kInterrupted);
  MakeRun(cell_.config, RunEnding::kRunning);
  EXPECT_EQ(State(), CellState::kInterrupted) << "its launcher was killed";
}

TEST_F(CellTest, FailedGoesOnToo) {
  MakeRun(cell_.config, RunEnding::kFailed);
  EXPECT_EQ(State(), CellState::kFailed);
}

TEST_F(CellTest, WithoutAStoreThereIsNothingToGoOnWith) {
  MakeRun(cell_.config, RunEnding::kInterrupted);
  std::filesystem::remove(run().replay_store());
  EXPECT_EQ(State(), CellState::kNew);
}

TEST_F(CellTest, OfAnotherConfigIsNamedFieldByField) {
  Config other = cell_.config;
  other.mutable_replay()->set_capacity(6000);
  other.mutable_launch()->set_max_episodes(11);
  MakeRun(other, RunEnding::kMaxEpisodes, /*with_results=*/true);
  const CellStanding standing = ReadStanding(cell_);
  EXPECT_EQ(standing.state, CellState::kChanged);
  EXPECT_THAT(standing.difference,
              AllOf(HasSubstr("replay.capacity: 6000 -> 5000"), HasSubstr("launch.max_episodes: 11 -> 10"),
                    Not(HasSubstr("launch.max_seconds"))));
}

TEST_F(CellTest, AConfigThatNobodyCanReadIsAnotherOne) {
  MakeRun(cell_.config, RunEnding::kInterrupted);
  ASSERT_TRUE(WriteFileAtomically(run().config(), "nonsense: 1").ok());
  const CellStanding standing = ReadStanding(cell_);
  EXPECT_EQ(standing.state, CellState::kChanged);
  EXPECT_THAT(standing.difference, HasSubstr("nonsense: unknown field"));
}

TEST_F(CellTest, FieldsWithoutInfluenceAndWrittenDefaultsMakeNoOtherConfig) {
  Config other = cell_.config;
  other.mutable_replay()->set_address("unix:/elsewhere/replay.sock");
  other.mutable_learner()->set_address("127.0.0.1:1");
  other.mutable_learner()->set_checkpoint_every_s(3);
  other.mutable_algorithm()->set_threads(2);
  other.mutable_algorithm()->mutable_dbr()->set_epsilon(0.05);  // the default
  other.mutable_replay()->mutable_seed_buffer()->set_path("/other/folder/hopper.hdf5");
  cell_.config.mutable_replay()->mutable_seed_buffer()->set_path("/folder/hopper.hdf5");
  MakeRun(other, RunEnding::kMaxEpisodes, /*with_results=*/true);
  EXPECT_EQ(State(), CellState::kDone) << ReadStanding(cell_).difference;
  cell_.config.mutable_replay()->mutable_seed_buffer()->set_path("/folder/walker.hdf5");
  EXPECT_THAT(ReadStanding(cell_).difference, HasSubstr("\"hopper.hdf5\" -> \"walker.hdf5\""));
}

TEST_F(CellTest, AtWhichAnotherLaunchIsAtWorkIsBusy) {
  MakeRun(cell_.config, RunEnding::kRunning);
  const auto lock = FolderClaim::OfRun(run().root);
  ASSERT_TRUE(lock.ok()) << lock.status();
  EXPECT_EQ(State(), CellState::kBusy);
}

TEST_F(CellTest, IsPreparedWithItsWholeConfigBesideTheFolder) {
  ASSERT_TRUE(PrepareCell(cell_).ok());
  const auto written = LoadConfig(cell_.config_file());
  ASSERT_TRUE(written.ok()) << written.status();
  EXPECT_EQ(written->replay().capacity(), 5000);
  EXPECT_FALSE(std::filesystem::exists(cell_.folder)) << "the launch makes it";
}

TEST_F(CellTest, MovesAsideWithItsLogAndDeletesNothing) {
  EXPECT_THAT(MoveAside(cell_, folder_.path()).value(), IsEmpty());
  for (const char* number : {"1", "2"}) {
    MakeRun(cell_.config, RunEnding::kInterrupted);
    ASSERT_TRUE(WriteFileAtomically(cell_.log(), number).ok());
    const auto moved = MoveAside(cell_, folder_.path());
    ASSERT_TRUE(moved.ok()) << moved.status();
    EXPECT_EQ(*moved, folder_ / (std::string("aside/connect4/dbr/seed-1.") + number));
    EXPECT_EQ(*ReadFile(*moved + "/replay.store"), "D");
    EXPECT_EQ(*ReadFile(*moved + ".log"), number);
    EXPECT_FALSE(std::filesystem::exists(cell_.folder));
    EXPECT_FALSE(std::filesystem::exists(cell_.log()));
  }
}

TEST_F(CellTest, LosesOnlyWhatContinuingNeeds) {
  MakeRun(cell_.config, RunEnding::kMaxEpisodes, /*with_results=*/true);
  ASSERT_TRUE(RemoveStores(cell_).ok());
  EXPECT_FALSE(std::filesystem::exists(run().replay_store()));
  EXPECT_FALSE(std::filesystem::exists(run().checkpoints()));
  EXPECT_EQ(*ReadFile(run().latest_policy()), "pi");
  EXPECT_EQ(State(), CellState::kDone);
  EXPECT_TRUE(RemoveStores(cell_).ok()) << "again";
}

}  // namespace
}  // namespace dbr
