// The supervisor over real processes.
#include "deploy/process/supervisor.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "core/monotonic_clock.h"
#include "deploy/process/child_process.h"
#include "deploy/process/log_tail.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

constexpr absl::Duration kLong = absl::Seconds(60);  // reached only where something is wrong

class SupervisorTest : public testing::Test {
 protected:
  // As in a terminal: whoever runs the tests may have told them to ignore some of these.
  SupervisorTest() {
    for (const int number : {SIGHUP, SIGINT, SIGCHLD}) signal(number, SIG_DFL);
  }

  std::unique_ptr<Supervisor> Make(SupervisorOptions options = {}) {
    if (options.first_restart_delay == SupervisorOptions().first_restart_delay)
      options.first_restart_delay = absl::Milliseconds(1);
    options.on_event = [this](const std::string& event, bool notable) {
      if (notable) events_.push_back(event);
    };
    auto supervisor = Supervisor::Create(std::move(options));
    EXPECT_TRUE(supervisor.ok()) << supervisor.status();
    return *std::move(supervisor);
  }

  ProcessSpec Child(const std::string& name, std::vector<std::string> orders) const {
    ProcessSpec spec;
    spec.name = name;
    spec.command = {absl::StrCat(DBR_BIN_DIR, "/../tests/deploy_test_child")};
    spec.command.insert(spec.command.end(), orders.begin(), orders.end());
    spec.log = folder_ / (name + ".log");
    return spec;
  }

  // Waits until the supervision fails, for at most kLong.
  static absl::Status Fail(Supervisor* supervisor) {
    const absl::Time deadline = MonotonicNow() + kLong;
    absl::Status status;
    while (status.ok() && MonotonicNow() < deadline) status = supervisor->Wait(deadline);
    return status;
  }

  std::vector<std::string> Lines(const std::string& path) const {
    const absl::StatusOr<std::string> text = ReadFile(path);
    return text.ok() ? absl::StrSplit(*text, '\n', absl::SkipEmpty()) : std::vector<std::string>();
  }

  TempDir folder_;
  std::vector<std::string> events_;
};

// A named pipe whose reader learns when everybody who held it has gone.
class Liveness {
 public:
  explicit Liveness(std::string path) : path_(std::move(path)) {
    EXPECT_EQ(mkfifo(path_.c_str(), 0600), 0);
    fd_ = open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  }
  ~Liveness() { close(fd_); }

  const std::string& path() const { return path_; }
  // Waits until `n` processes hold it.
  bool HeldBy(int n) const {
    for (int held = 0; held < n; ++held) {
      pollfd waiting = {fd_, POLLIN, 0};
      char byte;
      if (poll(&waiting, 1, static_cast<int>(absl::ToInt64Milliseconds(kLong))) != 1 ||
          read(fd_, &byte, 1) != 1)
        return false;
    }
    return true;
  }
  bool AllGoneWithin(absl::Duration timeout) const {
    pollfd waiting = {fd_, 0, 0};
    return poll(&waiting, 1, static_cast<int>(absl::ToInt64Milliseconds(timeout))) == 1;
  }

 private:
  std::string path_;
  int fd_;
};

TEST_F(SupervisorTest, RestartsAChildThatDiesAndGivesUpWithItsFirstFailure) {
  const auto supervisor = Make({.max_restarts = 2});
  const std::string starts = folder_ / "starts";
  ASSERT_TRUE(
      supervisor->Start(Child("learner", {"append", starts, "say", "critic loss is not finite", "exit", "1"}))
          .ok());
  const absl::Status status = Fail(supervisor.get());
  EXPECT_EQ(status.code(), absl::StatusCode::kAborted);
  EXPECT_THAT(std::string(status.message()), HasSubstr("learner died 3 times"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("exited with status 1"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("critic loss is not finite"));
  EXPECT_THAT(Lines(starts), SizeIs(3));
  EXPECT_EQ(supervisor->restarts(), 2);
  EXPECT_THAT(events_, ElementsAre(HasSubstr("starting it again (1 of at most 2"),
                                   HasSubstr("starting it again (2 of"), HasSubstr("died too often")));
}

TEST_F(SupervisorTest, NamesTheProcessThatFailedFirst) {
  const auto supervisor = Make({.max_restarts = 1});
  ASSERT_TRUE(supervisor->Start(Child("replay", {"say", "disk full", "exit", "1"})).ok());
  while (supervisor->restarts() == 0) ASSERT_TRUE(supervisor->Wait(MonotonicNow() + kLong).ok());
  ASSERT_TRUE(supervisor->Start(Child("actor-0", {"say", "no replay", "exit", "1"})).ok());
  const absl::Status status = Fail(supervisor.get());
  EXPECT_THAT(std::string(status.message()), HasSubstr("First failure: replay exited with status 1"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("disk full"));
}

// It saved nothing when it died, so that not everything is saved when all is stopped.
TEST_F(SupervisorTest, AChildThatWaitsForItsRestartDoesNotEndCleanly) {
  SupervisorOptions options;
  options.first_restart_delay = absl::Hours(1);
  const auto supervisor = Make(std::move(options));
  ASSERT_TRUE(supervisor->Start(Child("learner", {"exit", "1"})).ok());
  while (events_.empty()) ASSERT_TRUE(supervisor->Wait(MonotonicNow() + kLong).ok());
  EXPECT_THAT(events_, ElementsAre(HasSubstr("learner exited with status 1: starting it again")));
  EXPECT_FALSE(supervisor->Stop());
  EXPECT_THAT(events_.back(), HasSubstr("learner had died and is not started again"));
  EXPECT_TRUE(supervisor->Stop()) << "it is told once";
}

TEST_F(SupervisorTest, AddsTheRestartArgumentsWhenItStartsAgain) {
  const auto supervisor = Make({.max_restarts = 1});
  const std::string starts = folder_ / "starts";
  ProcessSpec spec = Child("replay", {"append", starts, "exit", "1"});
  spec.restart_arguments = {"--resume"};
  ASSERT_TRUE(supervisor->Start(spec).ok());
  EXPECT_FALSE(Fail(supervisor.get()).ok());
  EXPECT_THAT(Lines(starts), ElementsAre("exit 1 ", "exit 1 --resume "));
}

TEST_F(SupervisorTest, DoesNotRestartAChildThatRefusesItsConfig) {
  const auto supervisor = Make();
  ASSERT_TRUE(supervisor->Start(Child("actor-0", {"say", "env.name: unknown 'chess'", "exit", "2"})).ok());
  const absl::Status status = Fail(supervisor.get());
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("env.name: unknown 'chess'"));
  EXPECT_EQ(supervisor->restarts(), 0);
}

TEST_F(SupervisorTest, DoesNotRestartWhileToldNotTo) {
  const auto supervisor = Make();
  supervisor->set_restarting(false);
  ASSERT_TRUE(supervisor->Start(Child("replay", {"say", "the address is in use", "exit", "1"})).ok());
  const absl::Status status = Fail(supervisor.get());
  EXPECT_EQ(status.code(), absl::StatusCode::kAborted);
  EXPECT_THAT(std::string(status.message()), HasSubstr("the address is in use"));
  EXPECT_EQ(supervisor->restarts(), 0);
}

TEST_F(SupervisorTest, NamesTheSignalThatKilledAChild) {
  const auto supervisor = Make({.max_restarts = 0});
  ASSERT_TRUE(supervisor->Start(Child("actor-0", {"ignore-sigterm"})).ok());
  kill(supervisor->pid("actor-0"), SIGKILL);
  EXPECT_THAT(std::string(Fail(supervisor.get()).message()),
              HasSubstr("actor-0 was killed by signal 9 (Killed)"));
}

TEST_F(SupervisorTest, RefusesAProgramThatDoesNotExist) {
  const auto supervisor = Make();
  ProcessSpec spec = Child("replay", {});
  spec.command = {folder_ / "dbr-replay"};
  const absl::Status status = supervisor->Start(spec);
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("dbr-replay"));
}

TEST_F(SupervisorTest, StopsOneRankAfterTheOther) {
  const auto supervisor = Make();
  const std::string order = folder_ / "order";
  const std::vector<std::pair<std::string, int>> ranks = {
      {"replay", 2}, {"learner", 1}, {"actor-0", 0}, {"actor-1", 0}};
  for (const auto& [name, rank] : ranks) {
    ProcessSpec spec = Child(name, {"wait", order, name});
    spec.stop_rank = rank;
    ASSERT_TRUE(supervisor->Start(spec).ok());
  }
  EXPECT_TRUE(supervisor->Stop(/*last_rank=*/0));
  EXPECT_THAT(Lines(order), UnorderedElementsAre("actor-0", "actor-1"));
  EXPECT_EQ(supervisor->pid("actor-0"), 0);
  EXPECT_NE(supervisor->pid("learner"), 0);
  EXPECT_TRUE(supervisor->Stop());
  ASSERT_THAT(Lines(order), SizeIs(4));
  EXPECT_EQ(Lines(order)[2], "learner");
  EXPECT_EQ(Lines(order)[3], "replay");
  EXPECT_THAT(events_, IsEmpty());
}

// Another's death can come first that this one's failure caused.
TEST_F(SupervisorTest, TellsWhyAChildFailedThatItMeantToStop) {
  const auto supervisor = Make();
  const Liveness liveness(folder_ / "alive");
  ASSERT_TRUE(
      supervisor
          ->Start(Child("replay", {"say", "the address is in use", "hold", liveness.path(), "exit", "1"}))
          .ok());
  ASSERT_TRUE(liveness.HeldBy(1));
  EXPECT_FALSE(supervisor->Stop());
  EXPECT_THAT(events_, ElementsAre(AllOf(HasSubstr("replay exited with status 1 when it was stopped"),
                                         HasSubstr("the address is in use"))));
}

TEST_F(SupervisorTest, KillsAChildThatDoesNotStop) {
  const auto supervisor = Make();
  ProcessSpec spec = Child("learner", {"ignore-sigterm"});
  spec.stop_grace = absl::Milliseconds(20);
  ASSERT_TRUE(supervisor->Start(spec).ok());
  EXPECT_FALSE(supervisor->Stop());
  EXPECT_EQ(supervisor->pid("learner"), 0);
  EXPECT_THAT(events_, ElementsAre(HasSubstr("learner killed: still there 20ms after SIGTERM"),
                                   HasSubstr("signal 9")));
}

TEST_F(SupervisorTest, AnotherSignalKillsTheChildThatIsWaitedFor) {
  const auto supervisor = Make();
  ProcessSpec spec = Child("learner", {"wait-and-interrupt-parent"});
  spec.stop_grace = absl::Hours(1);
  ASSERT_TRUE(supervisor->Start(spec).ok());
  kill(getpid(), SIGINT);
  EXPECT_TRUE(supervisor->Wait(absl::InfiniteFuture()).ok());
  EXPECT_FALSE(supervisor->Stop());
  EXPECT_EQ(supervisor->stop_signals(), 2);
  EXPECT_THAT(events_, ElementsAre(HasSubstr("a second signal came"), HasSubstr("signal 9")));
}

// A run that comes to its limit stops without a signal: the first Ctrl-C asks for what is being done.
TEST_F(SupervisorTest, TheFirstSignalKillsNobodyWhereAllIsBeingStoppedAlready) {
  const auto supervisor = Make();
  ProcessSpec spec = Child("learner", {"wait-and-interrupt-parent-once"});
  spec.stop_grace = absl::Hours(1);
  ASSERT_TRUE(supervisor->Start(spec).ok());
  EXPECT_TRUE(supervisor->Stop());
  EXPECT_EQ(supervisor->stop_signals(), 1);
  EXPECT_THAT(events_, ElementsAre(HasSubstr("another signal kills")));
}

// As under nohup, and in the background of a script.
TEST_F(SupervisorTest, IgnoresTheSignalsThatItWasToldToIgnore) {
  for (const int number : {SIGHUP, SIGINT}) signal(number, SIG_IGN);
  const auto supervisor = Make();
  for (const int number : {SIGHUP, SIGINT, SIGTERM}) kill(getpid(), number);
  EXPECT_TRUE(supervisor->Wait(absl::InfiniteFuture()).ok());
  EXPECT_EQ(supervisor->stop_signals(), 1);
}

// The kernel then takes the status of each child that ends, unless we ask for it.
TEST_F(SupervisorTest, SeesItsChildrenEndThoughItsParentIgnoredSuchSignals) {
  signal(SIGCHLD, SIG_IGN);
  const auto supervisor = Make({.max_restarts = 0});
  ASSERT_TRUE(supervisor->Start(Child("learner", {"say", "no", "exit", "3"})).ok());
  EXPECT_THAT(std::string(Fail(supervisor.get()).message()), HasSubstr("exited with status 3"));
}

TEST_F(SupervisorTest, CountsStopSignalsAndReturnsAtOnce) {
  const auto supervisor = Make();
  int expected = 0;
  for (const int number : {SIGHUP, SIGINT, SIGTERM}) {
    kill(getpid(), number);
    EXPECT_TRUE(supervisor->Wait(absl::InfiniteFuture()).ok());
    EXPECT_EQ(supervisor->stop_signals(), ++expected);
  }
  kill(getpid(), SIGHUP);  // the terminal went away while we stop: no reason to kill anything
  EXPECT_TRUE(supervisor->Wait(absl::InfiniteFuture()).ok());
  EXPECT_EQ(supervisor->stop_signals(), expected);
}

TEST_F(SupervisorTest, TellsHowThoseThatRunOnceEndedAndStartsThemNoMore) {
  const auto supervisor = Make();
  const std::string starts = folder_ / "starts";
  for (const char* status : {"0", "3"}) {
    ProcessSpec spec = Child(status, {"append", starts, "exit", status});
    spec.once = true;
    ASSERT_TRUE(supervisor->Start(spec).ok());
  }
  std::vector<std::pair<std::string, std::string>> ends;
  const absl::Time deadline = MonotonicNow() + kLong;
  while (ends.size() < 2 && MonotonicNow() < deadline) {
    ASSERT_TRUE(supervisor->Wait(deadline).ok());
    for (const EndedProcess& ended : supervisor->TakeEnded())
      ends.emplace_back(ended.name, DescribeExit(ended.wait_status));
  }
  EXPECT_THAT(ends,
              UnorderedElementsAre(Pair("0", "exited with status 0"), Pair("3", "exited with status 3")));
  EXPECT_THAT(Lines(starts), SizeIs(2));
  EXPECT_THAT(supervisor->TakeEnded(), IsEmpty());
  EXPECT_THAT(events_, IsEmpty());
}

TEST_F(SupervisorTest, StopsThoseThatRunOnceWithTheOthers) {
  const auto supervisor = Make();
  const Liveness liveness(folder_ / "alive");
  ProcessSpec spec = Child("run", {"hold", liveness.path(), "wait", folder_ / "ends", "run"});
  spec.once = true;
  ASSERT_TRUE(supervisor->Start(spec).ok());
  ASSERT_TRUE(liveness.HeldBy(1));
  EXPECT_TRUE(supervisor->Stop());
  EXPECT_THAT(Lines(folder_ / "ends"), ElementsAre("run"));
  EXPECT_THAT(supervisor->TakeEnded(), SizeIs(1));
}

TEST_F(SupervisorTest, WakeEndsAWait) {
  const auto supervisor = Make();
  std::thread other([&] { supervisor->Wake(); });
  EXPECT_TRUE(supervisor->Wait(absl::InfiniteFuture()).ok());
  other.join();
}

TEST_F(SupervisorTest, LeavesNoOrphanWhenItIsKilled) {
  const Liveness liveness(folder_ / "fifo");
  const std::string stopped = folder_ / "stopped";
  const pid_t launcher = fork();
  if (launcher == 0) {
    const auto supervisor = Make({.orphan_grace = absl::Milliseconds(300)});
    // One that stops when it is told, and one that does not.
    if (!supervisor->Start(Child("learner", {"hold", liveness.path(), "wait", stopped, "learner"})).ok())
      _exit(1);
    if (!supervisor->Start(Child("actor-0", {"hold", liveness.path(), "ignore-sigterm"})).ok()) _exit(1);
    for (;;) pause();
  }
  ASSERT_TRUE(liveness.HeldBy(2));
  kill(launcher, SIGKILL);
  ASSERT_EQ(waitpid(launcher, nullptr, 0), launcher);
  EXPECT_TRUE(liveness.AllGoneWithin(kLong));
  EXPECT_THAT(Lines(stopped), ElementsAre("learner"));
}

TEST(LogTailTest, GivesTheLastLinesBehindTheStart) {
  TempDir folder;
  const std::string log = folder / "a.log";
  ASSERT_TRUE(WriteFileAtomically(log, "old\none\n\ntwo\nthree\n").ok());
  EXPECT_EQ(LogTail(log, 4, 2), "    two\n    three");
  EXPECT_EQ(LogTail(log, 4, 9), "    one\n    two\n    three");
  EXPECT_EQ(LogTail(log, 1000), "");
  EXPECT_EQ(LogTail(folder / "none.log", 0), "");
}

TEST(DescribeExitTest, SaysStatusOrSignal) {
  EXPECT_EQ(DescribeExit(W_EXITCODE(3, 0)), "exited with status 3");
  EXPECT_EQ(DescribeExit(W_EXITCODE(0, SIGTERM)), "was killed by signal 15 (Terminated)");
}

}  // namespace
}  // namespace dbr
