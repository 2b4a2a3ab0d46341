// Tests long learning runs with the real programs (label `slow`).
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "core/run_folder.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/reference_dir.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

// Waits for up to an hour, for slow and busy machines.
void AwaitTheEnd(DbrProcess* launch) {
  for (int patience = 0; patience < 12; ++patience) {
    if (launch->AwaitOutput("training ended")) break;
  }
  EXPECT_EQ(launch->Wait(), 0) << launch->output();
}

TEST(Learning, SacOnTheHopperReaches800Within60000Steps) {
  const TempDir folder;
  const RunFolder run{folder / "run"};
  DbrProcess launch("dbr", {"launch", DBR_SOURCE_DIR "/deploy/configs/hopper_medium.textproto", "--run-dir",
                            run.root, "--set", "launch.stop_at_return=800", "--set", "launch.max_steps=60000",
                            "--set", "evaluation.final_episodes=10"});
  AwaitTheEnd(&launch);
  EXPECT_EQ(Summary(run)["ended"], "stop_at_return") << launch.output();
}

// A single run differs from the next by luck: two of three must learn.
TEST(Learning, DbrOnTheHopperReaches800Within20000StepsInTwoOfThreeSeeds) {
  int reached = 0;
  std::string outputs;
  for (const char* seed : {"1", "2", "3"}) {
    const TempDir folder;
    const RunFolder run{folder / "run"};
    DbrProcess launch("dbr", {"launch", DBR_SOURCE_DIR "/deploy/configs/hopper.textproto", "--run-dir",
                              run.root, "--seed", seed, "--set", "network.hidden_sizes=[128, 128]", "--set",
                              "launch.stop_at_return=800", "--set", "launch.max_steps=20000", "--set",
                              "evaluation.every_updates=1000", "--set", "evaluation.final_episodes=10"});
    AwaitTheEnd(&launch);
    reached += Summary(run)["ended"] == "stop_at_return";
    outputs += launch.output();
  }
  EXPECT_GE(reached, 2) << outputs;
}

}  // namespace
}  // namespace dbr
