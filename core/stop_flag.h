// A request to stop that several threads look at or wait for.
#pragma once

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/monotonic_clock.h"

namespace dbr {

// Once set it stays set. Thread-safe.
class StopFlag {
 public:
  void Set() {
    absl::MutexLock lock(&mutex_);
    set_ = true;
  }
  bool IsSet() const {
    absl::MutexLock lock(&mutex_);
    return set_;
  }
  // Blocks until the flag is set or `timeout` has passed. Returns whether it is set.
  bool WaitFor(absl::Duration timeout) const {
    absl::MutexLock lock(&mutex_);
    return AwaitFor(&mutex_, absl::Condition(&set_), timeout);
  }

 private:
  mutable absl::Mutex mutex_;
  bool set_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace dbr
