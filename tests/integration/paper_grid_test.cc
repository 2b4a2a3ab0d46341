// Tests the paper's whole grid at its smallest scale, and its report, with the real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kCells = 156;

class PaperGridTest : public testing::Test {
 protected:
  // Short recordings of random actions replace the data of every quality: this test does not check what is
  // learned.
  void RecordSeedBuffers() const {
    std::filesystem::create_directory(data_);
    for (const std::string& robot : {"hopper", "walker2d", "half_cheetah", "ant"}) {
      const std::string first = absl::StrCat(data_, "/", robot, "-random.hdf5");
      const auto [status, output] = RunProgram("dbr", {"dataset", "record", "--env", robot, "--quality",
                                                       "random", "--steps", "1500", "--out", first});
      ASSERT_EQ(status, 0) << output;
      for (const std::string& quality : {"medium", "mixed"})
        std::filesystem::copy_file(first, absl::StrCat(data_, "/", robot, "-", quality, ".hdf5"));
    }
  }

  std::pair<int, std::string> Experiment() const {
    return RunProgram(
        "dbr", {"experiment", absl::StrCat(DBR_SOURCE_DIR, "/deploy/experiments/paper.textproto"), "--scale",
                "smoke", "--run-dir", runs_, "--data", data_});
  }

  const TempDir folder_;
  const std::string runs_ = folder_ / "runs";
  const std::string data_ = folder_ / "data";
};

TEST_F(PaperGridTest, EveryCellRunsIsNotRunTwiceAndIsInTheReport) {
  RecordSeedBuffers();
  auto [status, output] = Experiment();
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(output, HasSubstr(absl::StrCat(kCells, " of ", kCells, " cells done")));

  std::tie(status, output) = Experiment();
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(output, HasSubstr(absl::StrCat(kCells, " done already, 0 to run")));

  const std::string out = folder_ / "report";
  std::tie(status, output) = RunProgram("dbr", {"report", runs_, "--out", out});
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(
      Contents(out + "/report.md"),
      AllOf(HasSubstr("Connect 4 – MCTS 10"), HasSubstr("Hopper (offline, medium)"), HasSubstr("BRAC-vp"),
            HasSubstr("Double DQN"), HasSubstr("ARM: fixed"), Not(HasSubstr("not run"))));
  EXPECT_THAT(Contents(out + "/report.html"), AllOf(HasSubstr("<svg"), Not(HasSubstr("src=\"http"))));
}

}  // namespace
}  // namespace dbr
