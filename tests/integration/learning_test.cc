// Tests long learning runs with the real programs (label `slow`).
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/run_folder.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/reference_dir.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

TEST(Learning, SacOnTheHopperReaches800Within60000Steps) {
  const TempDir folder;
  const RunFolder run{folder / "run"};
  DbrProcess launch("dbr", {"launch", DBR_SOURCE_DIR "/deploy/configs/hopper_medium.textproto", "--run-dir",
                            run.root, "--set", "launch.stop_at_return=800", "--set", "launch.max_steps=60000",
                            "--set", "evaluation.final_episodes=10"});
  // The test waits for up to an hour, for slow and busy machines.
  for (int patience = 0; patience < 12; ++patience) {
    if (launch.AwaitOutput("training ended")) break;
  }
  EXPECT_EQ(launch.Wait(), 0) << launch.output();
  const auto summary = nlohmann::json::parse(Contents(run.summary()));
  EXPECT_EQ(summary["ended"], "stop_at_return") << launch.output();
}

}  // namespace
}  // namespace dbr
