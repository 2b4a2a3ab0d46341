// Tests offline training on a seed buffer and online fine-tuning, with the real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
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

constexpr int kSeedBufferRows = 3000;
constexpr int kOfflineUpdates = 200;  // as in finetune.textproto

class FinetuneTest : public testing::Test {
 protected:
  // Records a seed buffer of the hopper with random actions.
  void SetUp() override {
    const auto [status, output] =
        RunProgram("dbr", {"dataset", "record", "--env", "hopper", "--quality", "random", "--steps",
                           absl::StrCat(kSeedBufferRows), "--out", seed_buffer_});
    ASSERT_EQ(status, 0) << output;
  }

  std::vector<std::string> Arguments(std::vector<std::string> more = {},
                                     const std::string& config = "finetune") const {
    std::vector<std::string> arguments = {
        "launch",        absl::StrCat(DBR_SOURCE_DIR, "/tests/integration/", config, ".textproto"),
        "--run-dir",     run_.root,
        "--seed-buffer", seed_buffer_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  // Checks the numbers of the seed buffer that the replay server gives in JSON.
  static void ExpectWholeSeedBuffer(const Json& stats) {
    ASSERT_TRUE(stats.is_object());
    EXPECT_EQ(stats["seed_buffer_rows"], kSeedBufferRows);
    EXPECT_EQ(stats["seed_buffer"], kSeedBufferRows);
    EXPECT_EQ(stats["sources"]["seed_buffer"]["total"], kSeedBufferRows);
    EXPECT_GT(stats["seed_buffer_episodes"], 0);
  }

  TempDir folder_;
  const std::string seed_buffer_ = folder_ / "seed.hdf5";
  const RunFolder run_{folder_ / "run"};
};

TEST_F(FinetuneTest, GoesOnlineAfterTheOfflinePhaseAndKeepsItsSeedOverAResume) {
  DbrProcess launch("dbr", Arguments({"--set", "launch.max_steps=1000000"}));
  ASSERT_TRUE(launch.AwaitOutput("offline phase over")) << launch.output();
  EXPECT_THAT(launch.output(), AllOf(HasSubstr(absl::StrCat("seed buffer: ", seed_buffer_)),
                                     HasSubstr("the seed buffer holds 3,000 transitions")));
  // More transitions come in than the buffer has room for, and the seed buffer stays.
  Json stats;
  ASSERT_TRUE(launch.Await([&] {
    stats = Stats(run_);
    return stats.is_object() && stats["evicted"] > 0;
  })) << launch.output();
  ExpectWholeSeedBuffer(stats);
  EXPECT_EQ(stats["total"], 4000);
  EXPECT_EQ(stats["sources"]["seed_buffer"]["share"], 0.75);
  EXPECT_EQ(stats["sources"]["online"]["total"], 1000);
  EXPECT_GE(stats["sampled_offline"], kOfflineUpdates * 32);
  EXPECT_GT(stats["sources"]["seed_buffer"]["plus"], 0);
  EXPECT_GT(stats["sources"]["seed_buffer"]["minus"], 0);
  EXPECT_LE(stats["samples_per_insert"], 96 + 9.6) << "the offline phase does not count";
  launch.Signal(SIGINT);
  EXPECT_EQ(launch.Wait(), 130) << launch.output();
  const Json first = Summary(run_);
  EXPECT_EQ(first["ended"], "interrupted");
  EXPECT_GT(first["transitions"], 1000);
  EXPECT_GE(first["updates"], kOfflineUpdates);
  EXPECT_EQ(first["restarts"], 0);
  EXPECT_EQ(first["seed_buffer"]["path"], seed_buffer_);
  EXPECT_EQ(first["returns"]["seed_buffer"], stats["seed_buffer_return_mean"]);
  EXPECT_TRUE(first["returns"]["end"].is_null());

  const std::uint64_t steps = first["transitions"].get<std::uint64_t>() + 300;
  const auto [status, output] = RunProgram("dbr", {"launch", "--resume", "--run-dir", run_.root, "--set",
                                                   absl::StrCat("launch.max_steps=", steps)});
  ASSERT_EQ(status, 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("reached max_steps"), HasSubstr("of the seed buffer"),
                            HasSubstr("at the end")));
  const Json second = Summary(run_);
  EXPECT_EQ(second["ended"], "max_steps");
  EXPECT_EQ(second["launches"], 2);
  EXPECT_GE(second["transitions"], steps);
  EXPECT_GT(second["updates"], first["updates"]);
  EXPECT_EQ(second["seed_buffer"]["rows"], kSeedBufferRows);
  EXPECT_GE(second["evaluations"].size(), first["evaluations"].size());
  EXPECT_TRUE(second["returns"]["end"]["mean"].is_number());
  EXPECT_EQ(second["final"][0]["episodes"], 4);
  EXPECT_THAT(Contents(run_.log("replay")), HasSubstr("resumed"));
  EXPECT_THAT(Contents(run_.root + "/results.txt"), AllOf(HasSubstr("hopper"), HasSubstr("mean returns")));
  EXPECT_THAT(ProcessesOf("dbr", run_.root), IsEmpty());
}

TEST_F(FinetuneTest, ResumesInTheOfflinePhase) {
  DbrProcess launch("dbr", Arguments({"--set", "learner.offline_updates=1000000"}));
  ASSERT_TRUE(launch.Await([&] { return Counter(run_, "relabelled") > 0; })) << launch.output();
  launch.Signal(SIGINT);
  EXPECT_EQ(launch.Wait(), 130) << launch.output();
  const Json first = Summary(run_);
  EXPECT_EQ(first["ended"], "interrupted");
  EXPECT_EQ(first["transitions"], 0);
  EXPECT_FALSE(std::filesystem::exists(run_.log("actor-0")));

  const auto [status, output] =
      RunProgram("dbr", {"launch", "--resume", "--run-dir", run_.root, "--set", "learner.offline_updates=200",
                         "--set", "launch.max_steps=300"});
  ASSERT_EQ(status, 0) << output;
  EXPECT_THAT(output, HasSubstr("offline phase over"));
  const Json second = Summary(run_);
  EXPECT_EQ(second["ended"], "max_steps");
  EXPECT_GE(second["updates"], first["updates"]);
  EXPECT_EQ(second["seed_buffer"]["rows"], kSeedBufferRows);
}

TEST_F(FinetuneTest, OfflineAloneStartsNoActors) {
  const auto [status, output] = RunProgram("dbr", Arguments({"--set", "learner.max_updates=200"}));
  ASSERT_EQ(status, 0) << output;
  EXPECT_THAT(output,
              AllOf(HasSubstr("no actors"), HasSubstr("reached max_updates"), Not(HasSubstr("lowest"))));
  EXPECT_FALSE(std::filesystem::exists(run_.log("actor-0")));
  const Json summary = Summary(run_);
  EXPECT_EQ(summary["updates"], kOfflineUpdates);
  EXPECT_EQ(summary["transitions"], 0);
  EXPECT_EQ(summary["games"], 0);
  EXPECT_TRUE(summary["returns"]["lowest_online"].is_null());
}

// The seed buffer's actions are random, its episodes return about 20, and 200 updates do not better that. The
// same learner with actors stands upright for much of an episode in the end: 90 to 1,000 after 12,000 steps.
TEST_F(FinetuneTest, TheOnlinePartEndsAboveTheOfflinePart) {
  const auto [status, output] = RunProgram("dbr", Arguments({}, "finetune_designed"));
  ASSERT_EQ(status, 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("fine-tuning: the offline policy has a mean return of"),
                            HasSubstr("RETAIN, the seed buffer keeps 50% of each draw")));
  const Json summary = Summary(run_);
  const Json& offline = summary["returns"]["after_offline"];
  EXPECT_EQ(offline["updates"], kOfflineUpdates) << "the evaluation is of the very moment";
  EXPECT_EQ(offline["steps"], 0);
  EXPECT_LT(offline["return_mean"], 60);
  EXPECT_GT(summary["returns"]["end"]["mean"].get<double>(), 2 * offline["return_mean"].get<double>());
  // The first 500 transitions are the offline policy's: no update owes them anything.
  EXPECT_LE(summary["updates"], kOfflineUpdates + summary["transitions"].get<int>() - 500 + 110);
}

TEST_F(FinetuneTest, ADesignedRunGoesOnInThePhaseInWhichItWasStopped) {
  DbrProcess offline("dbr", Arguments({"--set", "learner.offline_updates=1000000"}, "finetune_designed"));
  ASSERT_TRUE(offline.Await([&] { return Counter(run_, "relabelled") > 0; })) << offline.output();
  offline.Signal(SIGINT);
  EXPECT_EQ(offline.Wait(), 130) << offline.output();
  EXPECT_THAT(offline.output(), Not(HasSubstr("fine-tuning:")));

  const std::vector<std::string> resume = {"launch",    "--resume",
                                           "--run-dir", run_.root,
                                           "--set",     "learner.offline_updates=200",
                                           "--set",     "launch.max_steps=100000"};
  DbrProcess online("dbr", resume);
  ASSERT_TRUE(online.Await([&] { return Counter(run_, "inserted") > 1000; })) << online.output();
  online.Signal(SIGINT);
  EXPECT_EQ(online.Wait(), 130) << online.output();
  EXPECT_THAT(online.output(), HasSubstr("fine-tuning:"));
  const Json first = Summary(run_);

  const std::uint64_t steps = first["transitions"].get<std::uint64_t>() + 500;
  const auto [status, output] =
      RunProgram("dbr", {"launch", "--resume", "--run-dir", run_.root, "--set",
                         absl::StrCat("launch.max_steps=", steps), "--set", "learner.offline_updates=200"});
  ASSERT_EQ(status, 0) << output;
  EXPECT_THAT(output, HasSubstr("RETAIN, the seed buffer keeps 50% of each draw"));
  EXPECT_THAT(Contents(run_.log("learner")), HasSubstr("resumed from"));
  const Json second = Summary(run_);
  EXPECT_GE(second["updates"].get<int>(), first["updates"].get<int>() + 300) << "no wait for 500 transitions";
}

TEST_F(FinetuneTest, StopsWhereAnEvaluationReachesTheReturn) {
  const auto [status, output] =
      RunProgram("dbr", Arguments({"--set", "launch.stop_at_return=1", "--set", "launch.max_steps=0", "--set",
                                   "learner.offline_updates=0"}));
  ASSERT_EQ(status, 0) << output;
  EXPECT_EQ(Summary(run_)["ended"], "stop_at_return");
  EXPECT_GE(Summary(run_)["evaluations"][0]["return_mean"], 1);
}

}  // namespace
}  // namespace dbr
