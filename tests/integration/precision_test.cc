// Tests what a user sees of the precision of matrix products: what runs, what is refused, and a run that goes
// on in another one. DNNL_MAX_CPU_ISA=AVX2 stands for a processor without AVX-512 and bfloat16.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::vector<std::string> kOlderProcessor = {"DNNL_MAX_CPU_ISA=AVX2"};

TEST(PrecisionTest, TheVersionSaysWhatMultiplies) {
  const auto [status, output] = RunProgram("dbr", {"--version"}, kOlderProcessor);
  EXPECT_EQ(status, 0);
  EXPECT_THAT(output, AllOf(HasSubstr("matrix products: OpenBLAS "), HasSubstr(", float32; no bfloat16: the"),
                            HasSubstr(" has avx2")));
  EXPECT_THAT(RunProgram("dbr", {"--version"}).second, HasSubstr("matrix products: "));
}

TEST(PrecisionTest, Bfloat16ThatTheProcessorLacksIsRefusedBeforeAnythingIsMade) {
  const TempDir folder;
  const std::string run = folder / "run";
  const auto refusal = AllOf(HasSubstr("network.precision: BFLOAT16 needs"), HasSubstr("found avx2"),
                             HasSubstr("DNNL_MAX_CPU_ISA=AVX2"), HasSubstr("Use AUTO or FLOAT32"));
  const auto [launched, launch_output] =
      RunProgram("dbr", {"launch", SmallConfig(), "--run-dir", run, "--set", "network.precision=BFLOAT16"},
                 kOlderProcessor);
  EXPECT_EQ(launched, 2);
  EXPECT_THAT(launch_output, refusal);
  const auto [tried, experiment_output] =
      RunProgram("dbr",
                 {"experiment", absl::StrCat(DBR_SOURCE_DIR, "/deploy/experiments/precision.textproto"),
                  "--scale", "smoke", "--run-dir", run},
                 kOlderProcessor);
  EXPECT_EQ(tried, 2);
  EXPECT_THAT(experiment_output, AllOf(refusal, HasSubstr("contender 'bfloat16'")));
  EXPECT_FALSE(std::filesystem::exists(run));
}

// The second part runs without what the first one may have had.
TEST(PrecisionTest, ARunGoesOnInAnotherPrecision) {
  const TempDir folder;
  const RunFolder run{folder / "run"};
  const std::vector<std::string> settings = {"--run-dir", run.root, "--set", "evaluation.final_episodes=10"};
  const auto launch = [&](std::vector<std::string> arguments, const std::vector<std::string>& environment) {
    arguments.insert(arguments.begin(), "launch");
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    return RunProgram("dbr", arguments, environment);
  };
  const auto [begun, first] = launch({SmallConfig(), "--set", "learner.max_updates=200"}, {});
  ASSERT_EQ(begun, 0) << first;
  const std::string kernels = Summary(run).value("matrix_products", "");
  EXPECT_NE(kernels, "");
  EXPECT_THAT(first, HasSubstr("the learner multiplied with " + kernels));

  const auto [resumed, second] =
      launch({"--resume", "--set", "learner.max_updates=400", "--set", "network.precision=FLOAT32"},
             kOlderProcessor);
  ASSERT_EQ(resumed, 0) << second;
  EXPECT_EQ(Summary(run)["updates"], 400);
  EXPECT_THAT(Summary(run).value("matrix_products", ""), testing::ContainsRegex("^OpenBLAS .*, float32$"));
  EXPECT_THAT(Contents(run.log("learner")), HasSubstr("at update 200"));
}

}  // namespace
}  // namespace dbr
