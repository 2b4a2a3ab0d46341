#include "core/monotonic_clock.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "core/stop_flag.h"

namespace dbr {
namespace {

TEST(MonotonicClockTest, NeverGoesBack) {
  const absl::Time before = MonotonicNow();
  EXPECT_GE(MonotonicNow(), before);
}

TEST(AwaitUntilTest, ReturnsAtOnceWhereTheConditionHoldsOrTheDeadlineHasPassed) {
  absl::Mutex mutex;
  absl::MutexLock lock(&mutex);
  bool yes = true, no = false;
  EXPECT_TRUE(AwaitUntil(&mutex, absl::Condition(&yes), absl::InfinitePast()));
  EXPECT_FALSE(AwaitUntil(&mutex, absl::Condition(&no), absl::InfinitePast()));
  EXPECT_FALSE(AwaitFor(&mutex, absl::Condition(&no), -absl::Seconds(1)));
}

TEST(AwaitUntilTest, WaitsForTheDeadline) {
  absl::Mutex mutex;
  absl::MutexLock lock(&mutex);
  bool no = false;
  const absl::Time deadline = MonotonicNow() + absl::Milliseconds(5);
  EXPECT_FALSE(AwaitUntil(&mutex, absl::Condition(&no), deadline));
  EXPECT_GE(MonotonicNow(), deadline);
}

TEST(AwaitUntilTest, EndsWhenAnotherThreadMakesTheConditionHold) {
  for (const absl::Duration timeout : {absl::Hours(1), absl::InfiniteDuration()}) {
    StopFlag stop;
    std::thread other([&stop] { stop.Set(); });
    EXPECT_TRUE(stop.WaitFor(timeout));
    other.join();
  }
}

// The mutex is free while a thread waits, also for other waits with deadlines of their own.
TEST(AwaitUntilTest, ManyThreadsWaitOnOneMutexAndEachEndsAtItsOwnTime) {
  absl::Mutex mutex;
  int ended = 0, to_end = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, i] {
      absl::MutexLock lock(&mutex);
      const auto mine = [&] { return to_end > i; };
      const bool held =
          AwaitFor(&mutex, absl::Condition(&mine), i < 4 ? absl::Milliseconds(1 + i) : absl::Hours(1));
      EXPECT_EQ(held, i >= 4);
      ++ended;
    });
  }
  {
    absl::MutexLock lock(&mutex);
    const auto short_ones = [&] { return ended == 4; };
    mutex.Await(absl::Condition(&short_ones));
    to_end = 8;
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(ended, 8);
}

// An alarm that is cancelled at the moment when it rings must neither be lost nor reach the next wait, whose
// alarm lies at the same place of the stack.
TEST(AwaitUntilTest, WaitsThatEndAsTheirDeadlineComesDoNotDisturbTheNext) {
  absl::Mutex mutex;
  bool on = false;
  bool done = false;
  std::thread switching([&] {
    for (int i = 0; i < 2000; ++i) {
      absl::MutexLock lock(&mutex);
      on = !on;
    }
    absl::MutexLock lock(&mutex);
    done = true;
  });
  const auto either = [&] { return on || done; };
  for (bool over = false; !over;) {
    absl::MutexLock lock(&mutex);
    AwaitFor(&mutex, absl::Condition(&either), absl::Microseconds(20));
    over = done;
  }
  switching.join();
  absl::MutexLock lock(&mutex);
  bool never = false;
  const absl::Time deadline = MonotonicNow() + absl::Milliseconds(2);
  EXPECT_FALSE(AwaitUntil(&mutex, absl::Condition(&never), deadline));
  EXPECT_GE(MonotonicNow(), deadline);
}

}  // namespace
}  // namespace dbr
