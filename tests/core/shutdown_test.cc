#include "core/shutdown.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <memory>

#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

// Puts the signal mask back, so that other tests of the program can be interrupted.
class ShutdownTest : public testing::Test {
 protected:
  ShutdownTest() {
    signal(SIGINT, SIG_DFL);  // whoever runs the tests may have told them to ignore it
    pthread_sigmask(SIG_SETMASK, nullptr, &old_mask_);
    BlockShutdownSignals();
  }
  ~ShutdownTest() override { pthread_sigmask(SIG_SETMASK, &old_mask_, nullptr); }

  bool WaitForCount(int count) {
    absl::MutexLock lock(&mutex_);
    const auto reached = [&] { return count_ >= count; };
    return mutex_.AwaitWithTimeout(absl::Condition(&reached), absl::Seconds(30));
  }
  std::unique_ptr<ShutdownWatcher> Watch() {
    return std::make_unique<ShutdownWatcher>([this] {
      absl::MutexLock lock(&mutex_);
      ++count_;
    });
  }

 private:
  sigset_t old_mask_;
  absl::Mutex mutex_;
  int count_ = 0;
};

TEST_F(ShutdownTest, EachSignalCallsBack) {
  const auto watcher = Watch();
  kill(getpid(), SIGTERM);
  EXPECT_TRUE(WaitForCount(1));
  kill(getpid(), SIGINT);
  EXPECT_TRUE(WaitForCount(2));
  kill(getpid(), SIGTERM);
  EXPECT_TRUE(WaitForCount(3));
}

TEST(StopSignalsTest, LeaveOutWhatTheProcessWasToldToIgnore) {
  for (const int number : {SIGINT, SIGHUP}) {
    signal(number, SIG_DFL);
    const sigset_t heard = StopSignals(/*hangup=*/true);
    EXPECT_EQ(sigismember(&heard, number), 1);
    signal(number, SIG_IGN);
    const sigset_t ignored = StopSignals(/*hangup=*/true);
    EXPECT_EQ(sigismember(&ignored, number), 0);
    EXPECT_EQ(sigismember(&ignored, SIGTERM), 1);
    signal(number, SIG_DFL);
  }
}

TEST_F(ShutdownTest, EndsWithoutASignal) {
  Watch().reset();
}

TEST_F(ShutdownTest, ASignalBeforeTheWatcherIsNotLost) {
  kill(getpid(), SIGTERM);
  const auto watcher = Watch();
  EXPECT_TRUE(WaitForCount(1));
}

TEST_F(ShutdownTest, AFileThatReachesItsLimitIsAnErrorOfTheWriteNotASignal) {
  const TempDir folder;
  const int fd = open((folder / "file").c_str(), O_WRONLY | O_CREAT, 0600);
  ASSERT_GE(fd, 0);
  rlimit old_limit;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &old_limit), 0);
  rlimit limit = old_limit;
  limit.rlim_cur = 1;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  EXPECT_EQ(write(fd, "xy", 2), 1);
  EXPECT_EQ(write(fd, "y", 1), -1);
  EXPECT_EQ(errno, EFBIG);
  EXPECT_EQ(setrlimit(RLIMIT_FSIZE, &old_limit), 0);
  close(fd);
}

TEST_F(ShutdownTest, ABrokenPipeIsAnErrorOfTheWriteNotASignal) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  close(ends[0]);
  EXPECT_EQ(write(ends[1], "x", 1), -1);
  EXPECT_EQ(errno, EPIPE);
  close(ends[1]);
}

}  // namespace
}  // namespace dbr
