// Tests whole runs: the real programs as processes, over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/reference_dir.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Json = nlohmann::json;

class LaunchTest : public testing::Test {
 protected:
  std::vector<std::string> Arguments(std::vector<std::string> more) const {
    std::vector<std::string> arguments = {"launch", SmallConfig(), "--run-dir", run_.root};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  TempDir folder_;
  const RunFolder run_{folder_ / "run"};
};

void ExpectWholeRunFolder(const RunFolder& run) {
  for (const std::string& file :
       {run.config(), run.summary(), run.metrics(), run.latest_policy(), run.root + "/results.txt"}) {
    EXPECT_TRUE(std::filesystem::exists(file)) << file;
  }
  for (const char* process : {"launch", "replay", "learner", "actor-0", "evaluator"}) {
    EXPECT_THAT(Contents(run.log(process)), Not(IsEmpty())) << process;
  }
  EXPECT_FALSE(std::filesystem::is_empty(run.checkpoints()));
  bool events = false;
  for (const auto& entry : std::filesystem::directory_iterator(run.root)) {
    events = events || absl::StrContains(entry.path().filename().string(), "tfevents");
  }
  EXPECT_TRUE(events) << "no TensorBoard event file";
  int rows = 0;
  for (const auto line : absl::StrSplit(Contents(run.metrics()), '\n', absl::SkipEmpty())) {
    EXPECT_TRUE(Json::accept(line)) << line;
    ++rows;
  }
  EXPECT_GT(rows, 0);
}

void ExpectPolicyCommandsWork(const RunFolder& run) {
  const auto [evaluated, score] = RunProgram("dbr", {"evaluate", "--policy", run.root, "--opponent", "random",
                                                     "--episodes", "400", "--seed", "7", "--json"});
  ASSERT_EQ(evaluated, 0) << score;
  const Json result = Json::parse(score);
  EXPECT_EQ(result["env"], "connect4");
  EXPECT_EQ(result["opponent"], "random");
  EXPECT_EQ(result["episodes"], 400);
  EXPECT_EQ(result["seed"], 7);
  EXPECT_EQ(result["policy"], "average");
  EXPECT_GT(result["score"]["mean"], 0.75);
  EXPECT_GT(result["return"]["mean"], 0.5);
  EXPECT_GT(result["score"]["stderr"], 0);

  const std::string tactics = (ReferenceDir() / "connect4" / "tactics.train.json").string();
  const auto [probed, shares_text] =
      RunProgram("dbr", {"probe", "--policy", run.latest_policy(), "--positions", tactics, "--json"});
  ASSERT_EQ(probed, 0) << shares_text;
  const Json shares = Json::parse(shares_text);
  EXPECT_EQ(shares["positions"], 200);
  for (const char* name : {"must_block", "must_win", "keeps_value_decisive", "best"}) {
    EXPECT_TRUE(shares[name].is_number()) << name;
  }
  const auto [drawn, figure] = RunProgram("dbr", {"probe", "--policy", run.root, "--moves", "444"});
  EXPECT_EQ(drawn, 0);
  EXPECT_THAT(figure, AllOf(HasSubstr("player 2 (○) to move"), HasSubstr("beta-")));
}

TEST_F(LaunchTest, LearnsToBeatRandomAndGoesOnWhereItStopped) {
  const auto [status, output] =
      RunProgram("dbr", Arguments({"--set", "learner.max_updates=2500", "--seed", "2"}));
  ASSERT_EQ(status, 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("reached max_updates"), HasSubstr("paper: DBR"), HasSubstr(run_.root)));
  ExpectWholeRunFolder(run_);
  const Json first = Summary(run_);
  EXPECT_EQ(first["ended"], "max_updates");
  EXPECT_EQ(first["policy"], "average");
  EXPECT_EQ(first["seed"], 2);
  EXPECT_EQ(first["restarts"], 0);
  EXPECT_GE(first["updates"], 2500);
  EXPECT_GT(first["games"], 0);
  ASSERT_EQ(first["final"].size(), 1);
  EXPECT_GT(first["final"][0]["score"]["mean"], 0.75) << "random itself scores 0.505";
  EXPECT_THAT(ProcessesOf("dbr", run_.root), IsEmpty());
  ExpectPolicyCommandsWork(run_);

  const auto [resumed, again] =
      RunProgram("dbr", {"launch", "--resume", "--run-dir", run_.root, "--set", "learner.max_updates=2800"});
  ASSERT_EQ(resumed, 0) << again;
  const Json second = Summary(run_);
  EXPECT_EQ(second["launches"], 2);
  EXPECT_GE(second["updates"], 2800);
  EXPECT_GT(second["games"], first["games"]);
  EXPECT_GT(second["transitions"], first["transitions"]);
  EXPECT_GT(second["policy_version"], first["policy_version"]);
  EXPECT_GT(second["training_s"], first["training_s"]);
  EXPECT_THAT(Contents(run_.log("learner")), HasSubstr("resumed from"));
  ASSERT_EQ(second["final"].size(), 1);
  EXPECT_GT(second["final"][0]["score"]["mean"], 0.75);
}

TEST_F(LaunchTest, CtrlCSavesEverythingAndLeavesNoOrphan) {
  DbrProcess launch("dbr", Arguments({}));
  ASSERT_TRUE(launch.Await([&] { return Counter(run_, "relabelled") > 0; })) << launch.output();
  const std::vector<pid_t> processes = ProcessesOf("dbr", run_.root);
  EXPECT_GE(processes.size(), 5);
  launch.Signal(SIGINT);
  EXPECT_EQ(launch.Wait(), 130) << launch.output();
  EXPECT_TRUE(AllEndWithin(processes, absl::ZeroDuration()));
  EXPECT_THAT(launch.output(),
              AllOf(HasSubstr("all is saved"), HasSubstr("dbr evaluate --policy"), Not(HasSubstr("paper"))));
  EXPECT_EQ(Summary(run_)["ended"], "interrupted");
  EXPECT_FALSE(std::filesystem::is_empty(run_.checkpoints()));
  const auto [status, score] =
      RunProgram("dbr", {"evaluate", "--policy", run_.root, "--opponent", "random", "--episodes", "20"});
  EXPECT_EQ(status, 0) << score;
}

TEST_F(LaunchTest, KillingTheLauncherLeavesNoOrphanAndTheRunGoesOn) {
  DbrProcess launch("dbr", Arguments({}));
  ASSERT_TRUE(launch.Await([&] { return Counter(run_, "relabelled") > 0; })) << launch.output();
  const std::vector<pid_t> processes = ProcessesOf("dbr", run_.root);
  EXPECT_GE(processes.size(), 5);
  launch.Signal(SIGKILL);
  EXPECT_EQ(launch.Wait(), -SIGKILL);
  EXPECT_TRUE(AllEndWithin(processes, kPatience));
  EXPECT_THAT(ProcessesOf("dbr", run_.root), IsEmpty());

  const auto [status, output] = RunProgram("dbr", Arguments({"--resume", "--set", "learner.max_updates=1",
                                                             "--set", "evaluation.final_episodes=10"}));
  EXPECT_EQ(status, 0) << output;
}

}  // namespace
}  // namespace dbr
