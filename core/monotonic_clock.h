// Time for intervals, limits and deadlines: nobody can set it, as an administrator or NTP sets the time of
// day.
#pragma once

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"

namespace dbr {

// The time of CLOCK_MONOTONIC, counted from an origin that has no meaning: compare it with, and subtract from
// it, other values of this function alone. Thread-safe. For labels (a metric's time, a folder's name) there
// is absl::Now(), which floors_test allows in few folders.
absl::Time MonotonicNow();

// Blocks until `condition` holds or MonotonicNow() comes to `deadline`; returns whether `condition` holds. It
// stands for absl::Mutex::AwaitWithDeadline, which waits by the time of day: when that is set back by two
// hours, the wait takes two hours longer. `condition` is evaluated as absl::Mutex::Await does it. Costs a few
// microseconds where it has to wait. Thread-safe.
bool AwaitUntil(absl::Mutex* mutex, const absl::Condition& condition, absl::Time deadline)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

// The same for `timeout` from now.
bool AwaitFor(absl::Mutex* mutex, const absl::Condition& condition, absl::Duration timeout)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

}  // namespace dbr
