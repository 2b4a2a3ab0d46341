// Runs two independent pieces of an update side by side.
#pragma once

#include <memory>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "proto/config.pb.h"

namespace dbr {

// The number of threads of an update. The config sets it. Where the config says 0, it is 2 on a machine with
// four cores or more, because the actors there leave a core free, else 1.
inline int UpdateThreads(const AlgorithmConfig& config) {
  if (config.threads() > 0) return static_cast<int>(config.threads());
  return std::thread::hardware_concurrency() >= 4 ? 2 : 1;
}

// Runs pairs of functions. With two threads the second function runs on a thread that the runner owns. The
// results do not depend on the number of threads. One caller at a time. Run allocates nothing.
class PairRunner {
 public:
  explicit PairRunner(int threads) {
    if (threads > 1) thread_ = std::thread([this] { Work(); });
  }
  ~PairRunner() {
    if (!thread_.joinable()) return;
    {
      absl::MutexLock lock(&mutex_);
      closed_ = true;
    }
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
    {
      absl::MutexLock lock(&mutex_);
      argument_ = &second;
      call_ = [](const void* function) { (*static_cast<const Second*>(function))(); };
    }
    first();
    absl::MutexLock lock(&mutex_);
    mutex_.Await(absl::Condition(this, &PairRunner::Idle));
  }

 private:
  bool Idle() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return call_ == nullptr; }
  bool HasWork() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return call_ != nullptr || closed_; }

  void Work() {
    for (;;) {
      void (*call)(const void*);
      const void* argument;
      {
        absl::MutexLock lock(&mutex_);
        mutex_.Await(absl::Condition(this, &PairRunner::HasWork));
        if (closed_) return;
        call = call_;
        argument = argument_;
      }
      call(argument);
      absl::MutexLock lock(&mutex_);
      call_ = nullptr;
    }
  }

  absl::Mutex mutex_;
  void (*call_)(const void*) ABSL_GUARDED_BY(mutex_) = nullptr;
  const void* argument_ ABSL_GUARDED_BY(mutex_) = nullptr;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace dbr
