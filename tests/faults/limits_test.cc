// Programs under the limits of `ulimit`: each ends in time, with a line and an exit status and not with a
// signal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// Runs `dbr ARGUMENTS` under `ulimit LIMIT`. A core file helps nobody here.
std::pair<int, std::string> Under(const std::string& limit, const std::string& arguments) {
  return RunProgram("/bin/bash", {"-c", absl::StrCat("ulimit -c 0; ulimit ", limit, "; cd ", DBR_SOURCE_DIR,
                                                     "; '", DBR_BIN_DIR, "/dbr' ", arguments)});
}

// From where the loader has just room for the libraries up to where all goes well.
TEST(LimitsTest, TooLittleAddressSpaceIsSaid) {
  for (const int kilobytes : {200000, 300000, 400000, 500000, 600000, 700000}) {
    const auto [status, output] =
        Under(absl::StrCat("-v ", kilobytes),
              "evaluate --policy deploy/policies/hopper_medium.safetensors --episodes 1");
    EXPECT_THAT(status, AnyOf(0, 1)) << kilobytes << output;
    EXPECT_THAT(output, Not(IsEmpty())) << kilobytes;
    if (status == 1) EXPECT_THAT(output, HasSubstr("ulimit")) << kilobytes;
  }
  EXPECT_EQ(Under("-v 200000", "algorithms").first, 0) << "it multiplies nothing";
}

TEST(LimitsTest, TooFewOpenFilesAreSaid) {
  for (const int files : {10, 16, 40, 63}) {
    const auto [status, output] = Under(absl::StrCat("-n ", files), "stats --replay 127.0.0.1:9");
    EXPECT_EQ(status, 1) << files << output;
    EXPECT_THAT(output, HasSubstr("too few open files")) << files;
  }
}

TEST(LimitsTest, AFileOfLimitedSizeIsAnError) {
  const TempDir folder;
  const RunFolder run{folder / "run"};
  const auto [status, output] =
      Under("-f 100", absl::StrCat("launch ", SmallConfig(), " --run-dir ", run.root));
  EXPECT_EQ(status, 1) << output;
  EXPECT_THAT(output, HasSubstr("File too large"));
  const auto [recorded, message] =
      Under("-f 10",
            absl::StrCat("dataset record --env hopper --quality random --steps 5000 --out ", folder / "h"));
  EXPECT_EQ(recorded, 1) << message;
  EXPECT_THAT(message, HasSubstr("/h: File too large. Raise the limit of `ulimit -f`"));
}

}  // namespace
}  // namespace dbr
