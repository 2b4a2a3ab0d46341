// Tests the program dbr-learner as a process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "core/run_folder.h"
#include "learner/runtime/checkpoints.h"
#include "replay/client/writer.h"
#include "replay/service/replay_server.h"
#include "tests/integration/dbr_process.h"
#include "tests/replay/rows.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

// No other try can mend that the server's transitions are a robot's.
TEST(LearnerProgram, AReplayServerOfAnotherEnvironmentEndsItForGood) {
  const TempDir folder;
  const RunFolder run{folder.path()};
  Config config;
  config.mutable_replay()->set_capacity(2000);
  config.mutable_replay()->set_min_size(1);
  constexpr TransitionLayout kRobot{15, 3, 0};
  ReplayServerOptions options = OptionsFrom(config, kRobot);
  options.server.address = run.replay_address();
  const auto replay = ReplayServer::Start(options);
  ASSERT_TRUE(replay.ok()) << replay.status();
  TransitionWriter writer({.address = run.replay_address(), .name = "other", .layout = kRobot});
  const Rows row(kRobot, 1, 1);
  ASSERT_TRUE(writer.Append(row.columns().Row(kRobot, 0), kUnjudged, 0, std::nullopt, kPatience).ok());
  std::ofstream(run.config()) << "network { hidden_sizes: [16, 16] } replay { capacity: 2000 }";
  const auto [status, output] = RunProgram("dbr-learner", {"--config", run.config(), "--run-dir", run.root});
  EXPECT_EQ(status, 2) << output;
  EXPECT_THAT(output, testing::HasSubstr("observation_width"));
  EXPECT_TRUE(absl::IsNotFound(Checkpoints(run.checkpoints(), 1).LoadNewest().status()))
      << "it has made no update that would be worth to be kept: " << output;
}

TEST(LearnerProgram, APrecisionThatTheProcessorLacksEndsItForGood) {
  const TempDir folder;
  const RunFolder run{folder.path()};
  std::ofstream(run.config()) << "network { precision: BFLOAT16 }";
  const auto [status, output] =
      RunProgram("dbr-learner", {"--config", run.config(), "--run-dir", run.root}, {"DNNL_MAX_CPU_ISA=AVX2"});
  EXPECT_EQ(status, 2) << output;
  EXPECT_THAT(output, testing::HasSubstr("network.precision: BFLOAT16 needs a processor with"));
}

TEST(LearnerProgram, AWrongConfigAndDamagedCheckpointsEndItForGood) {
  const TempDir folder;
  const RunFolder run{folder.path()};
  std::ofstream(run.config()) << "learner { push_every: 0 }";
  EXPECT_EQ(RunProgram("dbr-learner", {"--config", run.config(), "--run-dir", run.root}).first, 2);
  std::ofstream(run.config()) << "network { hidden_sizes: [16, 16] }";
  std::filesystem::create_directories(run.checkpoints());
  std::ofstream(run.checkpoints() + "/000000000001.safetensors") << "none";
  const auto [status, output] =
      RunProgram("dbr-learner", {"--config", run.config(), "--run-dir", run.root, "--resume"});
  EXPECT_EQ(status, 2) << output;
  EXPECT_THAT(output, testing::HasSubstr("is damaged"));
}

}  // namespace
}  // namespace dbr
