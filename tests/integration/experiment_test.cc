// Tests grids of runs with the real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/file_io.h"
#include "deploy/launch/commit.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Json = nlohmann::json;

class ExperimentTest : public testing::Test {
 protected:
  static std::string GridFile() {
    return absl::StrCat(DBR_SOURCE_DIR, "/tests/integration/experiment.textproto");
  }

  std::vector<std::string> Arguments(const std::string& grid, std::vector<std::string> more) const {
    std::vector<std::string> arguments = {"experiment", grid, "--run-dir", runs_, "--data", data_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  std::pair<int, std::string> Experiment(std::vector<std::string> more) const {
    return RunProgram("dbr", Arguments(GridFile(), std::move(more)));
  }

  RunFolder Run(const std::string& cell) const { return {absl::StrCat(runs_, "/", cell)}; }

  const TempDir folder_;
  const std::string runs_ = folder_ / "runs";
  const std::string data_ = folder_ / "data";
};

TEST_F(ExperimentTest, AFailedCellIsReportedAndDoesNotStopTheOthers) {
  const auto [status, output] = Experiment({"--only", "connect4"});
  EXPECT_EQ(status, 1) << output;
  EXPECT_THAT(
      output,
      AllOf(HasSubstr("experiment tiny at scale smoke: 2 cells, 0 done already, 2 to run"),
            HasSubstr("started connect4/dbr/seed-1"), HasSubstr("done connect4/dbr/seed-1 in "),
            HasSubstr(": random 0."), HasSubstr("FAILED connect4/deaf/seed-1: exited with status"),
            HasSubstr("/no/such/folder"), HasSubstr("whole log: " + runs_ + "/connect4/deaf/seed-1.log"),
            HasSubstr("1 of 2 cells done, 1 failed")));
  const RunFolder run = Run("connect4/dbr/seed-1");
  const Json summary = Summary(run);
  EXPECT_EQ(summary["ended"], "max_updates");
  EXPECT_EQ(summary["seed"], 1);
  EXPECT_EQ(summary["commit"], BuildCommit());
  EXPECT_EQ(summary["final"][0]["episodes"], 20);
  for (const std::string& kept :
       {run.config(), run.metrics(), run.latest_policy(), run.root + ".log", run.root + ".textproto"})
    EXPECT_TRUE(std::filesystem::exists(kept)) << kept;
  for (const std::string& removed : {run.replay_store(), run.checkpoints()})
    EXPECT_FALSE(std::filesystem::exists(removed)) << removed;
  EXPECT_THAT(ProcessesOf("dbr", runs_), IsEmpty());
}

TEST_F(ExperimentTest, WhatIsDoneIsNotRunAgainUnlessItsConfigChanged) {
  const std::vector<std::string> only = {"--only", "connect4/dbr", "--keep-stores"};
  auto [status, output] = Experiment(only);
  ASSERT_EQ(status, 0) << output;
  const RunFolder run = Run("connect4/dbr/seed-1");
  EXPECT_TRUE(std::filesystem::exists(run.replay_store()));
  const std::string first = Contents(run.summary());

  std::tie(status, output) = Experiment(only);
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(output, HasSubstr("1 done already, 0 to run"));
  EXPECT_EQ(Contents(run.summary()), first);

  const std::string changed = folder_ / "changed.textproto";
  ASSERT_TRUE(WriteFileAtomically(
                  changed, absl::StrReplaceAll(Contents(GridFile()), {{"epsilon: 0.1", "epsilon: 0.2"}}))
                  .ok());
  std::tie(status, output) = RunProgram("dbr", Arguments(changed, only));
  EXPECT_EQ(status, 1) << output;
  EXPECT_THAT(output,
              AllOf(HasSubstr("left alone: connect4/dbr/seed-1: run folder of another config"),
                    HasSubstr("algorithm.dbr.epsilon: 0.1 -> 0.2"), HasSubstr("--overwrite-changed")));
  EXPECT_EQ(Contents(run.summary()), first);

  std::tie(status, output) =
      RunProgram("dbr", Arguments(changed, {"--only", "connect4/dbr", "--overwrite-changed"}));
  EXPECT_EQ(status, 0) << output;
  EXPECT_EQ(Contents(runs_ + "/aside/connect4/dbr/seed-1.1/summary.json"), first);
  EXPECT_THAT(Contents(run.config()), HasSubstr("epsilon: 0.2"));
  EXPECT_EQ(Summary(run)["ended"], "max_updates");
}

TEST_F(ExperimentTest, CtrlCSavesTheRunningCellsAndTheSameCommandGoesOn) {
  const std::vector<std::string> arguments =
      Arguments(GridFile(), {"--only", "connect4/dbr", "--scale", "long"});
  const RunFolder run = Run("connect4/dbr/seed-1");
  DbrProcess first("dbr", arguments);
  ASSERT_TRUE(first.Await([&] { return Counter(run, "relabelled") > 0; })) << first.output();
  const std::vector<pid_t> processes = ProcessesOf("dbr", runs_);
  EXPECT_GE(processes.size(), 6) << "the experiment, the launch and what it started";
  first.Signal(SIGINT);
  EXPECT_EQ(first.Wait(), 130) << first.output();
  EXPECT_TRUE(AllEndWithin(processes, absl::ZeroDuration()));
  EXPECT_THAT(first.output(), AllOf(HasSubstr("stopping"), HasSubstr("0 of 1 cells done, 1 still to run"),
                                    HasSubstr("the same command goes on"), Not(HasSubstr("FAILED"))));
  const Json stopped = Summary(run);
  EXPECT_EQ(stopped["ended"], "interrupted");
  EXPECT_FALSE(std::filesystem::is_empty(run.checkpoints()));

  const auto [status, output] = RunProgram("dbr", arguments);
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("continuing connect4/dbr/seed-1"), HasSubstr("1 of 1 cells done")));
  const Json done = Summary(run);
  EXPECT_EQ(done["launches"], 2);
  EXPECT_EQ(done["ended"], "max_updates");
  EXPECT_GT(done["games"], stopped["games"]);
  EXPECT_THAT(Contents(run.log("learner")), HasSubstr("resumed from"));
}

TEST_F(ExperimentTest, AnOfflineCellNeedsItsSeedBufferAndStartsNoActors) {
  const std::vector<std::string> only = {"--only", "hopper-random"};
  auto [status, output] = Experiment(only);
  EXPECT_EQ(status, 2);
  const std::string seed = data_ + "/hopper-random.hdf5";
  EXPECT_THAT(output, AllOf(HasSubstr("task 'hopper-random': expected its seed buffer"),
                            HasSubstr("dbr dataset record --env hopper --quality random --steps 2000 --out " +
                                      seed)));
  EXPECT_FALSE(std::filesystem::exists(runs_));
  std::filesystem::create_directory(data_);
  std::tie(status, output) = RunProgram("dbr", {"dataset", "record", "--env", "hopper", "--quality", "random",
                                                "--steps", "2000", "--out", seed});
  ASSERT_EQ(status, 0) << output;
  std::tie(status, output) = Experiment({"--only", "hopper-random", "--dry-run"});
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(output, HasSubstr("to start                hopper-random/dbr/seed-1  1 core\n"));
  EXPECT_FALSE(std::filesystem::exists(runs_));
  std::tie(status, output) = Experiment(only);
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(output, HasSubstr(": return "));
  const RunFolder run = Run("hopper-random/dbr/seed-1");
  EXPECT_EQ(Summary(run)["transitions"], 0);
  EXPECT_FALSE(std::filesystem::exists(run.log("actor-0")));
}

TEST_F(ExperimentTest, TheVersionNamesTheCommit) {
  const auto [status, output] = RunProgram("dbr", {"--version"});
  EXPECT_EQ(status, 0);
  EXPECT_THAT(output, HasSubstr(absl::StrCat("commit ", BuildCommit())));
}

}  // namespace
}  // namespace dbr
