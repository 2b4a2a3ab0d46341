// Tests that a run keeps to its limits while somebody sets the machine's time of day.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "absl/time/time.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

// Holds what tests/support/clock_jump.cc reads.
class TimeOfDay {
 public:
  explicit TimeOfDay(const std::string& path) : path_(path) { Jump(absl::ZeroDuration()); }

  void Jump(absl::Duration by) const {
    const std::int64_t nanos = absl::ToInt64Nanoseconds(by);
    const int fd = open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    ASSERT_EQ(pwrite(fd, &nanos, sizeof nanos, 0), static_cast<ssize_t>(sizeof nanos));
    close(fd);
  }

  std::vector<std::string> Environment() const {
    return {"LD_PRELOAD=" DBR_CLOCK_JUMP_LIBRARY, "DBR_CLOCK_JUMP=" + path_};
  }

 private:
  const std::string path_;
};

class ClockTest : public testing::TestWithParam<int> {
 protected:
  TempDir folder_;
  const RunFolder run_{folder_ / "run"};
  const TimeOfDay time_of_day_{folder_ / "jump"};
};

TEST_P(ClockTest, ARunEndsAtItsLimitAndSavesThoughTheTimeOfDayJumps) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer must be loaded before other libraries";
#endif
  DbrProcess launch("dbr",
                    {"launch", SmallConfig(), "--run-dir", run_.root, "--set", "launch.max_seconds=12"},
                    time_of_day_.Environment());
  ASSERT_TRUE(launch.Await([&] { return Counter(run_, "relabelled") > 0; })) << launch.output();
  time_of_day_.Jump(absl::Hours(GetParam()));
  ASSERT_EQ(launch.Wait(), 0) << launch.output();
  EXPECT_THAT(launch.output(), Not(HasSubstr("NOT all could be saved")));
  const Json summary = Summary(run_);
  EXPECT_EQ(summary["ended"], "max_seconds");
  EXPECT_EQ(summary["restarts"], 0);
  // Seconds; on a machine that is slow beyond measure they grow, but not to the hours of the jump.
  for (const char* measured : {"training_s", "wall_s"}) {
    EXPECT_GE(summary[measured], 12) << measured;
    EXPECT_LT(summary[measured], 3600) << measured;
  }
  EXPECT_EQ(summary["final"].size(), 1);
}

INSTANTIATE_TEST_SUITE_P(Hours, ClockTest, testing::Values(2, -2));

}  // namespace
}  // namespace dbr
