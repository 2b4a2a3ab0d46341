// What a launch prepares before the first process starts.
#include "deploy/launch/run_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "deploy/launch/same_run.h"
#include "proto/config/config_file.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::Not;

const absl::Time kNow = absl::FromUnixSeconds(1700000000);

class RunPlanTest : public testing::Test {
 protected:
  RunPlanTest() {
    EXPECT_TRUE(WriteFileAtomically(config_, "env { name: 'connect4' } replay { capacity: 5000 }").ok());
  }

  LaunchOptions Options(std::vector<std::string> overrides = {}, bool resume = false) const {
    return {.config = config_, .overrides = std::move(overrides), .run_dir = run_, .resume = resume};
  }

  // As if the replay server had been there.
  void MakeStore() { ASSERT_TRUE(WriteFileAtomically(RunFolder{run_}.replay_store(), "rows").ok()); }

  TempDir folder_;
  const std::string config_ = folder_ / "config.textproto";
  const std::string run_ = folder_ / "run";
};

TEST_F(RunPlanTest, MakesTheFolderWithTheEffectiveConfig) {
  const auto plan = PrepareRun(Options({"launch.max_seconds=7"}), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  const auto written = LoadConfig(plan->folder.config());
  ASSERT_TRUE(written.ok()) << written.status();
  EXPECT_EQ(written->launch().max_seconds(), 7);
  EXPECT_EQ(written->replay().capacity(), 5000);
  EXPECT_TRUE(std::filesystem::is_directory(plan->folder.logs()));
  EXPECT_EQ(plan->replay_address, plan->folder.replay_address());
}

TEST_F(RunPlanTest, NamesTheFolderAfterTheRun) {
  std::filesystem::current_path(folder_.path());
  LaunchOptions options = Options();
  options.run_dir.clear();
  const auto plan = PrepareRun(options, kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->folder.root, absl::StrCat("runs/connect4-dbr-",
                                            absl::FormatTime("%Y%m%d-%H%M%S", kNow, absl::LocalTimeZone())));
}

// As two launches in one second do.
TEST_F(RunPlanTest, GivesTwoRunsOfOneNameFoldersOfTheirOwn) {
  std::filesystem::current_path(folder_.path());
  LaunchOptions options = Options();
  options.run_dir.clear();
  const auto first = PrepareRun(options, kNow), second = PrepareRun(options, kNow),
             third = PrepareRun(options, kNow);
  ASSERT_TRUE(first.ok() && second.ok() && third.ok()) << second.status();
  EXPECT_EQ(second->folder.root, first->folder.root + "-2");
  EXPECT_EQ(third->folder.root, first->folder.root + "-3");
}

TEST_F(RunPlanTest, RefusesAFolderThatExistsWithoutResume) {
  ASSERT_TRUE(PrepareRun(Options(), kNow).ok());
  ASSERT_TRUE(PrepareRun(Options(), kNow).ok()) << "nothing has begun yet";
  MakeStore();
  const auto again = PrepareRun(Options(), kNow);
  EXPECT_EQ(again.status().code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(again.status().message()), AllOf(HasSubstr(run_), HasSubstr("--resume")));
}

TEST_F(RunPlanTest, ABadConfigMakesNoFolder) {
  const auto plan = PrepareRun(Options({"replay.capacity=0", "actor.envs=0"}), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()),
              AllOf(HasSubstr("replay.capacity"), HasSubstr("actor.envs")));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

TEST_F(RunPlanTest, ResumesUnderOtherLimits) {
  ASSERT_TRUE(PrepareRun(Options({"launch.max_seconds=7"}), kNow).ok());
  const auto plan = PrepareRun(Options({"launch.max_seconds=9"}, true), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(LoadConfig(plan->folder.config())->launch().max_seconds(), 9);
}

TEST_F(RunPlanTest, ResumesWithTheFoldersOwnConfig) {
  ASSERT_TRUE(PrepareRun(Options({"launch.max_seconds=7"}), kNow).ok());
  LaunchOptions options = Options({}, true);
  options.config.clear();
  const auto plan = PrepareRun(options, kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->config.launch().max_seconds(), 7);
}

// The way out that a loss that is not finite is answered with.
TEST_F(RunPlanTest, ResumesUnderAnotherLearningRate) {
  ASSERT_TRUE(PrepareRun(Options(), kNow).ok());
  MakeStore();
  const auto plan =
      PrepareRun(Options({"algorithm.learning_rate=1e-4", "algorithm.learning_rate_decay_updates=1000",
                          "algorithm.final_learning_rate=1e-5", "algorithm.threads=1"},
                         true),
                 kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(LoadConfig(plan->claim->config_path())->algorithm().learning_rate(), 1e-4);
  ASSERT_TRUE(plan->claim->Begin().ok());
  EXPECT_EQ(LoadConfig(plan->folder.config())->algorithm().learning_rate(), 1e-4);
}

TEST_F(RunPlanTest, ResumesInAnotherPrecision) {
  ASSERT_TRUE(PrepareRun(Options(), kNow).ok());  // AUTO
  MakeStore();
  const auto plan = PrepareRun(Options({"network.precision=FLOAT32"}, true), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->config.network().precision(), NetworkConfig::FLOAT32);
}

TEST_F(RunPlanTest, RefusesToResumeAnotherRunAndNamesTheFields) {
  ASSERT_TRUE(PrepareRun(Options(), kNow).ok());
  MakeStore();
  const std::string before = *ReadFile(RunFolder{run_}.config());
  const auto plan = PrepareRun(
      Options({"replay.capacity=6000", "replay.byte_budget=100000000", "network.hidden_sizes=[64, 64]",
               "network.critic_layer_norm=true", "algorithm.dbr.epsilon=0.1", "seed=5",
               "algorithm.discount=0.9", "algorithm.n_step=3"},
              true),
      kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(
      std::string(plan.status().message()),
      AllOf(HasSubstr("replay.capacity: 5000 -> 6000"), HasSubstr("replay.byte_budget: 0 -> 100000000"),
            HasSubstr("hidden_sizes"), HasSubstr("network.critic_layer_norm: false -> true"),
            HasSubstr("epsilon"), HasSubstr("seed: 1 -> 5"), HasSubstr("algorithm.discount: 0.99 -> 0.9"),
            HasSubstr("algorithm.n_step: 1 -> 3")));
  EXPECT_EQ(*ReadFile(RunFolder{run_}.config()), before);
}

// The launch would count from nothing and overwrite what can still be repaired.
TEST_F(RunPlanTest, RefusesToResumeWhereTheSummaryIsDamaged) {
  ASSERT_TRUE(PrepareRun(Options(), kNow).ok());
  MakeStore();
  const std::string summary = RunFolder{run_}.summary();
  for (const char* damaged : {"", "{", "[]"}) {
    ASSERT_TRUE(WriteFileAtomically(summary, damaged).ok());
    const auto plan = PrepareRun(Options({}, true), kNow);
    EXPECT_THAT(std::string(plan.status().message()),
                AllOf(HasSubstr(summary), HasSubstr("Restore the file, or remove")));
    EXPECT_EQ(*ReadFile(summary), damaged);
  }
}

// It failed at its start, of its config perhaps.
TEST_F(RunPlanTest, ResumesARunThatNeverBeganAsANewOne) {
  ASSERT_TRUE(PrepareRun(Options(), kNow).ok());
  auto plan = PrepareRun(Options({"replay.capacity=6000"}, true), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_FALSE(plan->resume);
  EXPECT_EQ(LoadConfig(plan->folder.config())->replay().capacity(), 6000);
  plan->claim.reset();
  MakeStore();
  plan = PrepareRun(Options({"replay.capacity=6000"}, true), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_TRUE(plan->resume);
}

TEST_F(RunPlanTest, RefusesToResumeWhatIsNoRunFolder) {
  std::filesystem::create_directory(run_);
  const auto plan = PrepareRun(Options({}, true), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(plan.status().message()), HasSubstr("no config.textproto"));
}

TEST_F(RunPlanTest, RefusesAFolderInUse) {
  const auto plan = PrepareRun(Options(), kNow);
  ASSERT_TRUE(plan.ok());
  const auto second = PrepareRun(Options({}, true), kNow);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(second.status().message()), HasSubstr("in use by another launch"));
}

TEST_F(RunPlanTest, RefusesOneAddressForBothServices) {
  const auto plan =
      PrepareRun(Options({"replay.address='unix:/x.sock'", "learner.address='unix:/x.sock'"}), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()), HasSubstr("expected two addresses"));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

TEST_F(RunPlanTest, AnAddressThatIsNoneIsRefusedBeforeAFolderIsMade) {
  for (const char* field : {"replay.address", "learner.address"}) {
    for (const char* address : {"127.0.0.1:99999", "127.0.0.1", "::1:80", "unix:", "0.0.0.0:7000"}) {
      const auto plan = PrepareRun(Options({absl::StrCat(field, "='", address, "'")}), kNow);
      EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument) << address;
      EXPECT_THAT(std::string(plan.status().message()), AllOf(HasSubstr(field), HasSubstr(address)));
      EXPECT_FALSE(std::filesystem::exists(run_)) << address;
    }
  }
  EXPECT_TRUE(
      PrepareRun(Options({"replay.address='0.0.0.0:7000'", "replay.allow_insecure=true"}), kNow).ok());
}

TEST_F(RunPlanTest, RefusesAnAddressThatNobodyCouldBeTold) {
  const auto plan = PrepareRun(Options({"replay.address='127.0.0.1:0'"}), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()), HasSubstr("replay.address"));
}

TEST_F(RunPlanTest, StartsTheServicesBeforeThoseWhoUseThem) {
  auto plan = PrepareRun(Options({"actor.processes=2"}), kNow);
  ASSERT_TRUE(plan.ok());
  std::vector<ProcessSpec> all = Services(*plan, "bin");
  for (ProcessSpec& actor : Actors(*plan, "bin")) all.push_back(std::move(actor));
  std::vector<std::string> names;
  for (const ProcessSpec& process : all) {
    names.push_back(process.name);
    EXPECT_THAT(process.command, IsSupersetOf({std::string("--config"), plan->folder.config(),
                                               std::string("--run-dir"), run_}));
    EXPECT_THAT(process.command, Not(Contains("--resume")));
  }
  EXPECT_EQ(names, (std::vector<std::string>{"replay", "learner", "evaluator", "actor-0", "actor-1"}));
  EXPECT_EQ(all[0].command[0], "bin/dbr-replay");
  EXPECT_THAT(all[2].command, Contains("--evaluate"));
  EXPECT_THAT(all[4].command, IsSupersetOf({"--index", "1", "--processes", "2"}));
  EXPECT_LT(all[3].stop_rank, all[1].stop_rank);
  EXPECT_LT(all[1].stop_rank, all[0].stop_rank);
  plan->resume = true;
  const std::vector<ProcessSpec> resumed = Services(*plan, "bin");
  EXPECT_THAT(resumed[0].command, Contains("--resume"));
  EXPECT_THAT(resumed[1].command, Contains("--resume"));
  EXPECT_THAT(resumed[2].command, Contains("--resume"));
  EXPECT_THAT(Actors(*plan, "bin")[0].command, Not(Contains("--resume")));
}

TEST_F(RunPlanTest, RefusesAnUnknownEnvironmentBeforeItMakesAFolder) {
  const auto plan = PrepareRun(Options({"env.name=checkers"}), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()), HasSubstr("unknown environment \"checkers\""));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

TEST_F(RunPlanTest, RefusesNoiseOnDiscreteActionsBeforeItMakesAFolder) {
  const auto plan = PrepareRun(Options({"actor.action_noise=0.1"}), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()), HasSubstr("actor.action_noise: expected 0"));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

TEST_F(RunPlanTest, RefusesOpponentsThatThereAreNotBeforeItMakesAFolder) {
  for (const char* field : {"evaluation.opponents", "evaluation.final_opponents"}) {
    const auto plan = PrepareRun(Options({absl::StrCat(field, "=['random', 'mcts:1O']")}), kNow);
    EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(plan.status().message()),
                AllOf(HasSubstr(absl::StrCat(field, ": ")), HasSubstr("unknown opponent \"mcts:1O\"")));
  }
  const auto plan = PrepareRun(Options({"env.name=hopper", "evaluation.final_opponents=['random']"}), kNow);
  EXPECT_THAT(std::string(plan.status().message()),
              HasSubstr("evaluation.final_opponents: environment hopper has no opponents"));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

TEST_F(RunPlanTest, RefusesHowNobodyCouldChooseBeforeItMakesAFolder) {
  const auto error_of = [&](std::vector<std::string> overrides) {
    return std::string(PrepareRun(Options(std::move(overrides)), kNow).status().message());
  };
  EXPECT_THAT(error_of({"env.name=hopper", "actor.mode=SUPPORT"}),
              AllOf(HasSubstr("actor.mode: expected SAMPLE, MODE or GREEDY_Q"), HasSubstr("dbr on hopper")));
  EXPECT_THAT(error_of({"evaluation.final_episodes=2000000"}),
              HasSubstr("evaluation.final_episodes: expected 1 to 1048576, found 2000000"));
  ASSERT_TRUE(WriteFileAtomically(config_, "env { name: 'connect4' } algorithm { bear {} }").ok());
  EXPECT_THAT(error_of({"evaluation.mode=SUPPORT"}),
              AllOf(HasSubstr("evaluation.mode: expected"), HasSubstr("bear on connect4")));
  EXPECT_FALSE(std::filesystem::exists(run_));
  ASSERT_TRUE(WriteFileAtomically(config_, "env { name: 'connect4' } algorithm { dbr {} }").ok());
  EXPECT_TRUE(PrepareRun(Options({"evaluation.mode=SUPPORT"}), kNow).ok());
}

TEST_F(RunPlanTest, RefusesAnAlgorithmThatDoesNotServeTheActionsBeforeItMakesAFolder) {
  ASSERT_TRUE(WriteFileAtomically(config_, "env { name: 'connect4' } algorithm { sac {} }").ok());
  const auto plan = PrepareRun(Options(), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()),
              AllOf(HasSubstr("discrete actions of environment 'connect4'"), HasSubstr("found sac")));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

TEST_F(RunPlanTest, RefusesImagesWhereThereIsNoSymmetryBeforeItMakesAFolder) {
  const auto plan = PrepareRun(Options({"env.name=hopper", "algorithm.mirror=true"}), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()),
              AllOf(HasSubstr("algorithm.mirror: expected false"), HasSubstr("'hopper' has no symmetry")));
  EXPECT_FALSE(std::filesystem::exists(run_));
  EXPECT_TRUE(PrepareRun(Options({"env.name=connect4", "algorithm.mirror=true"}), kNow).ok());
}

TEST_F(RunPlanTest, RefusesTheMunchausenTermOverSeveralStepsBeforeItMakesAFolder) {
  const auto plan = PrepareRun(Options({"algorithm.n_step=3", "algorithm.dbr.munchausen_weight=0.9"}), kNow);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(plan.status().message()), HasSubstr("algorithm.n_step: expected 1 with"));
  EXPECT_FALSE(std::filesystem::exists(run_));
  EXPECT_TRUE(PrepareRun(Options({"algorithm.n_step=3"}), kNow).ok());
}

TEST(DefaultActorsTest, LeavesCoresToTheServices) {
  EXPECT_EQ(DefaultActors(1), 1);
  EXPECT_EQ(DefaultActors(2), 1);
  EXPECT_EQ(DefaultActors(8), 4);
}

TEST(CheckSameRunTest, ADefaultThatIsWrittenOutIsNoDifference) {
  Config before, now;
  now.mutable_algorithm()->mutable_dbr()->set_epsilon(0.05);
  now.mutable_env()->set_name("connect4");
  before.mutable_algorithm()->mutable_dbr();
  EXPECT_TRUE(CheckSameRun(before, now).ok()) << CheckSameRun(before, now);
}

}  // namespace
}  // namespace dbr
