// Tests wrong flags, configs, folders and files: each gets a clear line and an exit status, and nothing is
// lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "proto/rpc/server.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class BadInputTest : public testing::Test {
 protected:
  std::pair<int, std::string> Launch(std::vector<std::string> more) const {
    std::vector<std::string> arguments = {"launch", SmallConfig(), "--run-dir", run_.root};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram("dbr", arguments);
  }

  TempDir folder_;
  const RunFolder run_{folder_ / "run"};
};

TEST_F(BadInputTest, WrongFlagsExitWith2) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"fly"},
      {"launch", "--fast"},
      {"launch"},
      {"launch", "--resume"},
      {"stats"},
      {"stats", "--replay", "nothing"},
      {"evaluate", "--policy", "x", "--episodes", "0"},
      {"evaluate", "--policy", "x", "--mode", "best"},
      {"probe", "--policy", "x"},
      {"probe", "--policy", "x", "--moves", "4", "--positions", "y"}};
  for (const auto& arguments : wrong) {
    const auto [status, output] = RunProgram("dbr", arguments);
    EXPECT_EQ(status, 2) << testing::PrintToString(arguments) << output;
    EXPECT_THAT(output, Not(IsEmpty()));
  }
}

TEST_F(BadInputTest, AWordThatIsNoCommandIsNamed) {
  const auto [status, message] = RunProgram("dbr", {"launhc", "x.textproto"});
  EXPECT_EQ(status, 2);
  EXPECT_THAT(message, HasSubstr("unknown command 'launhc'; did you mean 'launch'?"));
  EXPECT_THAT(RunProgram("dbr", {"train"}).second, AllOf(HasSubstr("'train'"), HasSubstr("launch, stats")));
}

// It waits for a file that does not come: a signal ends it as it ends other programs.
TEST_F(BadInputTest, ACommandThatSavesNothingEndsOnASignal) {
  ASSERT_EQ(mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  for (const int number : {SIGINT, SIGTERM}) {
    DbrProcess launch("dbr", {"launch", folder_ / "fifo"});
    launch.Signal(number);
    EXPECT_THAT(launch.Wait(), ::testing::AnyOf(-number, 130)) << launch.output();
  }
}

TEST_F(BadInputTest, EveryCommandHasHelpWithAnExample) {
  for (const char* command : {"launch", "stats", "evaluate", "probe"}) {
    const auto [status, output] = RunProgram("dbr", {command, "--help"});
    EXPECT_EQ(status, 0);
    EXPECT_THAT(output, AllOf(HasSubstr("Examples:"), HasSubstr(absl::StrCat("dbr ", command, " "))));
  }
}

TEST_F(BadInputTest, ABadConfigNamesAllItsFieldsAndMakesNoFolder) {
  const auto [status, output] =
      Launch({"--set", "replay.capacity=0", "--set", "actor.epsilon=7", "--set", "network.layers=3"});
  EXPECT_EQ(status, 2);
  EXPECT_THAT(output,
              AllOf(HasSubstr("replay.capacity"), HasSubstr("actor.epsilon"), HasSubstr("network.layers")));
  EXPECT_FALSE(std::filesystem::exists(run_.root));

  ASSERT_TRUE(WriteFileAtomically(folder_ / "damaged.textproto", "replay { capacity: \x01\xff").ok());
  const auto [damaged, message] =
      RunProgram("dbr", {"launch", folder_ / "damaged.textproto", "--run-dir", run_.root});
  EXPECT_EQ(damaged, 2);
  EXPECT_THAT(message, HasSubstr("damaged.textproto"));
  EXPECT_EQ(RunProgram("dbr", {"launch", folder_ / "none.textproto"}).first, 1);
}

TEST_F(BadInputTest, WhatOnlyAProcessCanRefuseEndsTheLaunchWithItsWords) {
  const auto [status, output] = Launch({"--set", "env.name='chess'"});
  EXPECT_EQ(status, 2) << output;
  EXPECT_THAT(output, HasSubstr("chess"));
}

TEST_F(BadInputTest, ACapacityLargerThanTheMachineIsRefused) {
  const auto [status, output] = Launch({"--set", "replay.capacity=1000000000000"});
  EXPECT_NE(status, 0);
  EXPECT_THAT(output, HasSubstr("capacity"));
  EXPECT_EQ(Summary(run_)["ended"], "failed");
}

TEST_F(BadInputTest, AnAddressInUseIsNamed) {
  const auto taken = StartServer({.address = "127.0.0.1:0"}, {});
  ASSERT_TRUE(taken.ok()) << taken.status();
  const auto [status, output] = Launch({"--set", absl::StrCat("replay.address='", taken->address, "'")});
  EXPECT_EQ(status, 2) << output;
  EXPECT_THAT(output, AllOf(HasSubstr(taken->address), HasSubstr("in use")));
  EXPECT_THAT(ProcessesOf("dbr", run_.root), IsEmpty());
}

TEST_F(BadInputTest, AnAddressThatIsNoneMakesNoFolder) {
  const auto [status, output] = Launch({"--set", "replay.address='127.0.0.1:99999'"});
  EXPECT_EQ(status, 2) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("replay.address: "), HasSubstr("port '99999'")));
  EXPECT_FALSE(std::filesystem::exists(run_.root));
}

// A comma, a percent sign, brackets of a URI, and more bytes than the path of a socket has.
TEST_F(BadInputTest, ARunFolderOfAnyNameTrainsAndAnswers) {
  const RunFolder run{folder_ / ("a run, 100%41 #1?[x]*\n\xff " + std::string(200, 'y'))};
  DbrProcess launch("dbr", {"launch", SmallConfig(), "--run-dir", run.root});
  ASSERT_TRUE(launch.AwaitOutput("updates/s")) << launch.output();
  const auto [asked, stats] = RunProgram("dbr", {"stats", "--replay", run.root, "--json"});
  EXPECT_EQ(asked, 0) << stats;
  launch.Signal(SIGINT);
  EXPECT_EQ(launch.Wait(), 130) << launch.output();
  const auto [status, output] =
      RunProgram("dbr", {"launch", "--resume", "--run-dir", run.root, "--set", "launch.max_seconds=1",
                         "--set", "evaluation.final_episodes=2"});
  EXPECT_EQ(status, 0) << output;
}

TEST_F(BadInputTest, AServerThatIsNotThereIsNamed) {
  const auto [status, output] =
      RunProgram("dbr", {"stats", "--replay", absl::StrCat("unix:", folder_ / "none.sock")});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(output, HasSubstr("none.sock"));
}

TEST_F(BadInputTest, DamagedCheckpointsAndPoliciesAreRefusedByName) {
  ASSERT_EQ(Launch({"--set", "learner.max_updates=1500", "--set", "learner.checkpoint_every_s=1", "--set",
                    "evaluation.final_episodes=10"})
                .first,
            0);
  const std::uint64_t updates = Summary(run_)["updates"];
  std::vector<std::string> checkpoints;
  for (const auto& entry : std::filesystem::directory_iterator(run_.checkpoints()))
    checkpoints.push_back(entry.path());
  std::sort(checkpoints.begin(), checkpoints.end());
  // There is an older complete checkpoint and a newest one that is truncated.
  const std::string newest = absl::StrCat(run_.checkpoints(), "/999999999999.safetensors");
  std::filesystem::copy_file(checkpoints.back(), newest);
  std::filesystem::resize_file(newest, std::filesystem::file_size(newest) / 2);
  const auto [status, output] =
      Launch({"--resume", "--set", absl::StrCat("learner.max_updates=", updates + 100), "--set",
              "evaluation.final_episodes=10"});
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(Contents(run_.log("learner")),
              AllOf(HasSubstr("refused a damaged checkpoint"), HasSubstr(newest)));
  EXPECT_GE(Summary(run_)["updates"], updates + 100);

  std::filesystem::resize_file(run_.latest_policy(), 1000);
  const auto [evaluated, message] = RunProgram("dbr", {"evaluate", "--policy", run_.root});
  EXPECT_EQ(evaluated, 1);
  EXPECT_THAT(message, HasSubstr(run_.latest_policy()));

  const auto [other, refusal] = Launch({"--resume", "--set", "network.hidden_sizes=[32, 32]"});
  EXPECT_EQ(other, 2);
  EXPECT_THAT(refusal, AllOf(HasSubstr("hidden_sizes"), HasSubstr(run_.root)));
}

TEST_F(BadInputTest, AFolderThatIsNoRunCannotBeResumed) {
  std::filesystem::create_directory(run_.root);
  const auto [status, output] = Launch({"--resume"});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(output, HasSubstr("is no run folder"));
}

}  // namespace
}  // namespace dbr
