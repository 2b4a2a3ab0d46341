// Tests what becomes of a run folder when a launch in it fails, and of a launch whose output nobody reads.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class ResumeTest : public testing::Test {
 protected:
  std::pair<int, std::string> Launch(std::vector<std::string> more) const {
    std::vector<std::string> arguments = {"launch", "--run-dir", run_.root};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram("dbr", arguments);
  }

  // The files that a run ends with.
  std::map<std::string, std::string> Results() const {
    std::map<std::string, std::string> files;
    for (const std::string& path : {run_.config(), run_.summary(), run_.root + "/results.txt"})
      files[path] = Contents(path);
    return files;
  }

  TempDir folder_;
  const RunFolder run_{folder_ / "run"};
};

TEST_F(ResumeTest, AResumeThatFailsChangesNothingOfAFinishedRun) {
  const auto [finished, output] = Launch({SmallConfig(), "--set", "learner.max_updates=200"});
  ASSERT_EQ(finished, 0) << output;
  const auto before = Results();
  for (const auto& [path, text] : before) ASSERT_NE(text, "") << path;

  // The launcher refuses the first by the field's name, a service the second.
  const auto [other_store, refusal] = Launch({"--resume", "--set", "replay.byte_budget=100000000"});
  EXPECT_EQ(other_store, 2);
  EXPECT_THAT(refusal, HasSubstr("replay.byte_budget: 0 -> 100000000"));
  EXPECT_EQ(Results(), before);
  const auto [too_much, failure] = Launch({"--resume", "--set", "replay.min_size=60000"});
  EXPECT_EQ(too_much, 2);
  EXPECT_THAT(failure, HasSubstr("replay.min_size: expected 1 to the"));
  EXPECT_EQ(Results(), before);

  const auto [resumed, more] = Launch({"--resume", "--set", "learner.max_updates=250"});
  ASSERT_EQ(resumed, 0) << more;
  EXPECT_GE(Summary(run_)["updates"], 250);
  EXPECT_THAT(Contents(run_.config()), HasSubstr("max_updates: 250"));
  EXPECT_NE(Results(), before);
}

TEST_F(ResumeTest, AStartThatFailedDoesNotStandInTheWayOfTheNext) {
  const auto [refused, why] = Launch({SmallConfig(), "--set", "replay.min_size=60000"});
  EXPECT_EQ(refused, 2) << why;
  EXPECT_EQ(Summary(run_)["ended"], "failed");
  const auto [started, output] = Launch({SmallConfig(), "--set", "learner.max_updates=20"});
  EXPECT_EQ(started, 0) << output;
  const auto [again, exists] = Launch({SmallConfig(), "--set", "learner.max_updates=20"});
  EXPECT_EQ(again, 1);
  EXPECT_THAT(exists, HasSubstr("exists already"));
}

TEST_F(ResumeTest, ARunWhoseFolderIsMovedEndsAndSaysSo) {
  DbrProcess launch("dbr", {"launch", SmallConfig(), "--run-dir", run_.root});
  ASSERT_TRUE(launch.Await([&] { return Counter(run_, "relabelled") > 0; })) << launch.output();
  std::filesystem::rename(run_.root, folder_ / "moved");
  EXPECT_EQ(launch.Wait(), 1);
  EXPECT_THAT(launch.output(), HasSubstr("was moved or removed while the run was at work"));
  EXPECT_THAT(ProcessesOf("dbr", run_.root), IsEmpty());
  EXPECT_FALSE(std::filesystem::exists(run_.root)) << "nobody makes it anew";
  EXPECT_TRUE(std::filesystem::exists(folder_ / "moved/summary.json"));
}

// What stands in the place of the folder of checkpoints, or of the summary, keeps them from being written.
TEST_F(ResumeTest, ARunThatCannotSaveItsEndHasFailed) {
  for (const bool checkpoints : {true, false}) {
    const RunFolder run{folder_ / (checkpoints ? "no-checkpoints" : "no-summary")};
    DbrProcess launch("dbr",
                      {"launch", SmallConfig(), "--run-dir", run.root, "--set", "launch.max_steps=80000"});
    ASSERT_TRUE(launch.Await([&] { return Counter(run, "relabelled") > 0; })) << launch.output();
    if (checkpoints) {
      std::filesystem::rename(run.checkpoints(), run.root + "/aside");
      ASSERT_TRUE(WriteFileAtomically(run.checkpoints(), "in the way").ok());
    } else {
      std::filesystem::remove(run.summary());
      std::filesystem::create_directories(run.summary() + "/in the way");
    }
    EXPECT_EQ(launch.Wait(), 1) << launch.output();
    EXPECT_THAT(launch.output(), HasSubstr(checkpoints ? "NOT all could be saved" : run.summary()));
    EXPECT_THAT(launch.output(), Not(HasSubstr("final evaluation")));
    if (checkpoints) EXPECT_EQ(Summary(run)["ended"], "failed");
  }
}

// A named pipe that is full, and that nobody reads.
class StalledReader {
 public:
  explicit StalledReader(std::string path) : path_(std::move(path)) {
    EXPECT_EQ(mkfifo(path_.c_str(), 0600), 0);
    fd_ = open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    const std::string page(4096, '.');
    while (write(fd_, page.data(), page.size()) > 0) {
    }
  }
  ~StalledReader() { close(fd_); }
  const std::string& path() const { return path_; }

 private:
  const std::string path_;
  int fd_;
};

TEST_F(ResumeTest, ARunEndsAndSavesThoughNobodyReadsItsOutput) {
  const StalledReader reader(folder_ / "stalled");
  const auto [status, words] =
      RunProgram("/bin/sh", {"-c", "exec \"$0\" \"$@\" > " + reader.path(), DBR_BIN_DIR "/dbr", "launch",
                             SmallConfig(), "--run-dir", run_.root, "--set", "learner.max_updates=50"});
  EXPECT_EQ(status, 0) << words;
  EXPECT_EQ(Summary(run_)["ended"], "max_updates");
  EXPECT_THAT(Contents(run_.log("launch")), AllOf(HasSubstr("all is saved"), Not(HasSubstr("NOT all"))));
  EXPECT_THAT(Contents(run_.root + "/results.txt"), HasSubstr("random"));
}

}  // namespace
}  // namespace dbr
