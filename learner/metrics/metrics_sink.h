// Where a run's figures go: a line of metrics.jsonl and an event for TensorBoard each.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/monotonic_clock.h"
#include "core/run_folder.h"
#include "learner/metrics/append_file.h"
#include "learner/metrics/event_file.h"
#include "learner/metrics/tags.h"

namespace dbr {

// The two files that a run's figures go to. Thread-safe. A row is written to disk by the first call of Write
// at or after `flush_interval` from the write before, by Flush, or by the destructor. Nothing is lost by an
// error: what could not be written is tried again by the next call that writes.
class MetricsSink {
 public:
  // Appends to `folder`'s metrics.jsonl, which a resumed run goes on with (a row that a killed process left
  // unfinished is cut off), and starts an event file beside it. `now` names the event file; `clock` is what
  // the interval goes by. Errors as core/file_io.h's.
  static absl::StatusOr<std::unique_ptr<MetricsSink>> Open(const RunFolder& folder,
                                                           absl::Duration flush_interval, absl::Time now,
                                                           std::function<absl::Time()> clock = MonotonicNow);
  ~MetricsSink();
  MetricsSink(const MetricsSink&) = delete;
  MetricsSink& operator=(const MetricsSink&) = delete;

  // Tells TensorBoard that the learner begins at `step`, in updates: it drops what earlier event files hold
  // of this step and later ones, which a learner that was killed had reached and this one reaches again. What
  // still holds of that, the rows that count transitions, is repeated from metrics.jsonl. Belongs before the
  // first Write. O(size of metrics.jsonl). Errors are those of the files.
  absl::Status StartSession(std::int64_t step, absl::Time now) ABSL_LOCKS_EXCLUDED(mutex_);

  // Adds the row {"step": ..., "wall_time": seconds, tag: value, ...}; a value that is not finite is null
  // there. Blocks only to write the rows, and not where another thread is writing. Errors are those of the
  // file.
  absl::Status Write(std::int64_t step, absl::Time now, const Scalars& scalars) ABSL_LOCKS_EXCLUDED(mutex_);

  // Writes all rows that were added before; waits for another thread that is writing.
  absl::Status Flush() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  MetricsSink(std::string path, std::unique_ptr<AppendFile> rows, std::unique_ptr<AppendFile> events,
              absl::Duration flush_interval, std::function<absl::Time()> clock);
  // Writes what is pending. The caller has set writing_, which is cleared here.
  absl::Status WritePending() ABSL_LOCKS_EXCLUDED(mutex_);
  bool Idle() const ABSL_SHARED_LOCKS_REQUIRED(mutex_) { return !writing_; }

  const std::string path_;  // of the rows
  // Touched by the thread that has set writing_, without the lock.
  const std::unique_ptr<AppendFile> rows_;
  const std::unique_ptr<AppendFile> events_;
  const absl::Duration flush_interval_;
  const std::function<absl::Time()> clock_;  // of the interval

  absl::Mutex mutex_;
  std::string pending_rows_ ABSL_GUARDED_BY(mutex_);
  std::string pending_events_ ABSL_GUARDED_BY(mutex_);
  absl::Time last_write_ ABSL_GUARDED_BY(mutex_);
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace dbr
