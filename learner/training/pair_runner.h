// Runs two independent pieces of an update side by side.
#pragma once

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <atomic>
#include <thread>

#include "absl/synchronization/mutex.h"
#include "nn/flush_denormals.h"
#include "proto/config.pb.h"

namespace dbr {

// The number of threads of an update. The config sets it. Where the config says 0, it is 2 on a machine with
// four cores or more, because the actors there leave a core free, else 1.
inline int UpdateThreads(const AlgorithmConfig& config) {
  if (config.threads() > 0) return static_cast<int>(config.threads());
  return std::thread::hardware_concurrency() >= 4 ? 2 : 1;
}

// Runs pairs of functions. With two threads the second function runs on a thread that the runner owns, with
// denormal numbers as zeros, as in the caller's (nn/flush_denormals.h). The results do not depend on the
// number of threads. One caller at a time. Run allocates nothing.
//
// An update hands over some eight times, for parts of 50 microseconds and more. A thread that sleeps takes
// about as long to wake, so that both threads first look `looks` times whether the other has come.
class PairRunner {
 public:
  explicit PairRunner(int threads, int looks = kLooks) : looks_(looks) {
    if (threads > 1) thread_ = std::thread([this] { Work(); });
  }
  ~PairRunner() {
    if (!thread_.joinable()) return;
    Hand(kClosed);
    thread_.join();
  }
  PairRunner(const PairRunner&) = delete;
  PairRunner& operator=(const PairRunner&) = delete;

  // Blocks until both functions have returned. They must not touch the same data.
  template <class First, class Second>
  void Run(const First& first, const Second& second) {
    if (!thread_.joinable()) {
      first();
      second();
      return;
    }
    argument_ = &second;
    call_ = [](const void* function) { (*static_cast<const Second*>(function))(); };
    Hand(kSecond);
    first();
    AwaitTurn(kCaller);
  }

 private:
  enum Turn : int { kCaller, kSecond, kClosed };
  static constexpr int kLooks = 2000;  // 30 to 90 microseconds, by the processor

  // Says whose turn it is, and wakes the other thread if it sleeps.
  void Hand(Turn turn) {
    absl::MutexLock lock(&mutex_);
    turn_.store(turn, std::memory_order_release);
  }

  // Blocks until the turn is `turn`, or kClosed.
  void AwaitTurn(Turn turn) {
    const auto has_come = [this, turn] {
      const int now = turn_.load(std::memory_order_acquire);
      return now == turn || now == kClosed;
    };
    for (int look = 0; look < looks_; ++look) {
      if (has_come()) return;
#if defined(__x86_64__)
      _mm_pause();
#endif
    }
    absl::MutexLock lock(&mutex_);
    mutex_.Await(absl::Condition(&has_come));
  }

  void Work() {
    const FlushDenormals flush;
    for (;;) {
      AwaitTurn(kSecond);
      if (turn_.load(std::memory_order_acquire) == kClosed) return;
      call_(argument_);
      Hand(kCaller);
    }
  }

  const int looks_;
  absl::Mutex mutex_;  // held where the turn changes, so that no wake-up is missed
  std::atomic<int> turn_{kCaller};
  void (*call_)(const void*) = nullptr;  // written by the caller before kSecond
  const void* argument_ = nullptr;
  std::thread thread_;
};

}  // namespace dbr
