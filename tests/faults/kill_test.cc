// Kills the processes of a run, one after the other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using Json = nlohmann::json;

class KillTest : public testing::Test {
 protected:
  // Kills a process of the run with SIGKILL and waits until the launcher has logged it.
  void Kill(DbrProcess* launch, const std::string& name) {
    const pid_t pid = NewestProcess(name);
    ASSERT_GT(pid, 0) << name;
    kill(pid, SIGKILL);
    ASSERT_TRUE(launch->AwaitOutput(absl::StrCat(name, " was killed by signal 9"))) << launch->output();
    ASSERT_TRUE(AllEndWithin({pid}, kPatience));
  }

  // Reads it from the launcher's log: "NAME started (process PID)".
  pid_t NewestProcess(const std::string& name) const {
    pid_t newest = 0;
    for (const absl::string_view line : absl::StrSplit(Contents(run_.log("launch")), '\n')) {
      const std::vector<absl::string_view> parts = absl::StrSplit(line, " (process ");
      if (parts.size() != 2 || !absl::StrContains(parts[0], absl::StrCat("] ", name, " started"))) continue;
      newest = std::atoi(std::string(parts[1]).c_str());
    }
    return newest;
  }

  TempDir folder_;
  const RunFolder run_{folder_ / "run"};
};

// Expects that no writer's sequence has a gap, and that every transition of the server came from a writer.
void ExpectNothingLost(const Json& stats) {
  std::uint64_t sum = 0;
  for (const Json& writer : stats["writers"]) {
    EXPECT_EQ(writer["inserted"], writer["last_sequence"]) << writer;
    EXPECT_EQ(writer["refused"], 0) << writer;
    sum += writer["inserted"].get<std::uint64_t>();
  }
  EXPECT_EQ(stats["inserted"], sum) << stats["writers"];
}

TEST_F(KillTest, ARunSurvivesTheDeathOfEachProcess) {
  DbrProcess launch("dbr",
                    {"launch", SmallConfig(), "--run-dir", run_.root, "--set", "learner.max_updates=8000"});
  ASSERT_TRUE(launch.Await([&] { return Counter(run_, "relabelled") > 0; })) << launch.output();

  Json before = Stats(run_);
  ASSERT_THAT(before["writers"], SizeIs(1));
  ExpectNothingLost(before);
  Kill(&launch, "actor-0");
  // The new process is another writer. The transitions that the dead one had inserted stay.
  ASSERT_TRUE(launch.Await([&] {
    const Json now = Stats(run_);
    return now.is_object() && now["writers"].size() == 2 && now["writers"][1]["inserted"] > 0;
  })) << launch.output();
  Json now = Stats(run_);
  ExpectNothingLost(now);
  EXPECT_GE(now["inserted"], before["inserted"]);

  before = now;
  Kill(&launch, "learner");
  ASSERT_TRUE(launch.Await([&] {
    return Counter(run_, "relabelled") > before["relabelled"].get<std::uint64_t>() + 10000;
  })) << launch.output();
  now = Stats(run_);
  ExpectNothingLost(now);
  EXPECT_THAT(now["writers"], SizeIs(2));
  EXPECT_GE(now["inserted"], before["inserted"]);

  before = now;
  Kill(&launch, "replay");
  ASSERT_TRUE(launch.Await([&] {
    return Counter(run_, "inserted") > before["inserted"].get<std::uint64_t>();
  })) << launch.output();
  EXPECT_GE(Stats(run_)["total"], before["total"]);

  ASSERT_EQ(launch.Wait(), 0) << launch.output();
  const Json summary = Summary(run_);
  EXPECT_EQ(summary["ended"], "max_updates") << launch.output();
  EXPECT_EQ(summary["restarts"], 3);
  ASSERT_THAT(summary["final"], SizeIs(1));
  EXPECT_GT(summary["final"][0]["score"]["mean"], 0.75);
  const std::string log = Contents(run_.log("launch"));
  for (const char* name : {"actor-0", "learner", "replay"}) {
    EXPECT_THAT(log, HasSubstr(absl::StrCat(name, " was killed by signal 9 (Killed): starting it again")));
    EXPECT_THAT(log, HasSubstr(absl::StrCat(name, " started again")));
  }
}

}  // namespace
}  // namespace dbr
