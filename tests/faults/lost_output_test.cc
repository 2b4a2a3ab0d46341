// What a command prints is its result: where it is lost, the command has failed, and says so.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "absl/strings/match.h"
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

// Runs `dbr ARGUMENTS` by the shell, which sends its output as `redirection` says.
std::pair<int, std::string> Shell(const std::string& arguments, const std::string& redirection) {
  return RunProgram("/bin/bash", {"-c", absl::StrCat("set -o pipefail; cd ", DBR_SOURCE_DIR, "; '",
                                                     DBR_BIN_DIR, "/dbr' ", arguments, " ", redirection)});
}

constexpr char kPolicy[] = "--policy deploy/policies/hopper_medium.safetensors";

class LostOutputTest : public testing::Test {
 protected:
  const TempDir folder_;
};

TEST_F(LostOutputTest, EveryCommandWhoseOutputIsItsResultFailsWithoutIt) {
  const std::string file = folder_ / "hopper.hdf5";
  const std::string record =
      absl::StrCat("dataset record --env hopper --quality random --steps 100 --out ", file);
  for (const std::string& arguments :
       {std::string("--help"), std::string("--version"), std::string("launch --help"),
        std::string("algorithms"), std::string("algorithms dbr --json"), std::string("completion bash"),
        record, absl::StrCat("dataset info ", file), absl::StrCat("dataset info --json ", file),
        absl::StrCat("dataset convert ", file, " --to d4rl --out ", folder_ / "copy.hdf5"),
        absl::StrCat("evaluate ", kPolicy, " --episodes 1"),
        absl::StrCat("evaluate ", kPolicy, " --episodes 1 --json"),
        absl::StrCat(
            "experiment deploy/experiments/paper.textproto --scale smoke --only 'connect4*' --dry-run "
            "--run-dir ",
            folder_ / "runs")}) {
    const auto [whole, text] = Shell(arguments, "2>&1");
    EXPECT_EQ(whole, 0) << arguments << text;
    EXPECT_THAT(text, Not(IsEmpty()));
    for (const char* lost : {">/dev/full", ">&-"}) {
      const auto [status, message] = Shell(arguments, lost);
      EXPECT_EQ(status, 1) << arguments << lost;
      EXPECT_THAT(message, HasSubstr("the output is lost, or a part of it: ")) << arguments << lost;
    }
  }
}

TEST_F(LostOutputTest, AReaderThatHasSeenEnoughIsToldNothing) {
  const auto [status, output] = Shell("algorithms", "| true");
  EXPECT_EQ(status, 141) << "as of a program that the closed pipe's signal ended";
  EXPECT_THAT(output, Not(HasSubstr("lost")));
}

TEST_F(LostOutputTest, AFailureKeepsItsStatus) {
  const auto [status, output] = Shell("evaluate --policy none.safetensors", ">/dev/full");
  EXPECT_EQ(status, 1);
  EXPECT_THAT(output, AllOf(HasSubstr("none.safetensors"), Not(HasSubstr("lost"))));
  EXPECT_EQ(Shell("evaluate --fast", ">/dev/full").first, 2);
}

// Its results are files, and the terminal that it was started from may be gone by then.
TEST_F(LostOutputTest, ARunGoesOnWithoutItsOutput) {
  const RunFolder run{folder_ / "run"};
  const auto [status, output] =
      Shell(absl::StrCat("launch ", SmallConfig(), " --run-dir ", run.root, " --set learner.max_updates=50"),
            ">/dev/full");
  EXPECT_EQ(status, 0) << output;
  EXPECT_EQ(Summary(run)["ended"], "max_updates");
}

}  // namespace
}  // namespace dbr
