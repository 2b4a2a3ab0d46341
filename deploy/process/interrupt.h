// Handles Ctrl-C in a command that has nothing to save.
#pragma once

#include <atomic>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/monotonic_clock.h"
#include "core/shutdown.h"

namespace dbr {

// The exit status of an interrupted command, as shells use it.
inline constexpr int kInterruptedExit = 130;

// Remembers the StopSignals() from its construction on; before, they end the command. Make it before threads
// are started. Thread-safe.
class Interrupt {
 public:
  Interrupt() : watcher_([this] { Set(); }) {}

  const std::atomic<bool>& flag() const { return flag_; }

  // Blocks for `duration` or until a signal. Returns whether a signal came.
  bool WaitFor(absl::Duration duration) {
    absl::MutexLock lock(&mutex_);
    return AwaitFor(&mutex_, absl::Condition(&set_), duration);
  }

 private:
  void Set() {
    flag_ = true;
    absl::MutexLock lock(&mutex_);
    set_ = true;
  }

  std::atomic<bool> flag_ = false;
  absl::Mutex mutex_;
  bool set_ ABSL_GUARDED_BY(mutex_) = false;
  ShutdownWatcher watcher_;  // last: its thread uses the members above
};

}  // namespace dbr
