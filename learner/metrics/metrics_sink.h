// Where a run's figures go: a line of metrics.jsonl and an event for TensorBoard each.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/run_folder.h"
#include "learner/metrics/append_file.h"
#include "learner/metrics/event_file.h"

namespace dbr {

// Tags that Stable-Baselines3 gives the same quantities, so that its users' dashboards fit. Other tags begin
// with who measured: "replay/total", "learner/starved_share".
namespace tags {
inline constexpr char kEpisodeReturn[] = "rollout/ep_rew_mean";
inline constexpr char kEpisodeLength[] = "rollout/ep_len_mean";
inline constexpr char kEpisodeScore[] = "rollout/success_rate";
inline constexpr char kTransitionsPerSecond[] = "time/fps";
inline constexpr char kEpisodes[] = "time/episodes";
inline constexpr char kTransitions[] = "time/total_timesteps";
inline constexpr char kActorLoss[] = "train/actor_loss";
inline constexpr char kCriticLoss[] = "train/critic_loss";
inline constexpr char kUpdates[] = "train/n_updates";
inline constexpr char kEvaluationReturn[] = "eval/mean_reward";
inline constexpr char kEvaluationScore[] = "eval/success_rate";
}  // namespace tags

// The two files that a run's figures go to. Thread-safe. A row is written to disk by the first call of Write
// at or after `flush_interval` from the write before, by Flush, or by the destructor. Nothing is lost by an
// error: what could not be written is tried again by the next call that writes.
class MetricsSink {
 public:
  // Appends to `folder`'s metrics.jsonl, which a resumed run goes on with (a row that a killed process left
  // unfinished is cut off), and starts an event file beside it. `now` names the event file. Errors as
  // core/file_io.h's.
  static absl::StatusOr<std::unique_ptr<MetricsSink>> Open(const RunFolder& folder,
                                                           absl::Duration flush_interval, absl::Time now);
  ~MetricsSink();
  MetricsSink(const MetricsSink&) = delete;
  MetricsSink& operator=(const MetricsSink&) = delete;

  // Adds the row {"step": ..., "wall_time": seconds, tag: value, ...}; a value that is not finite is null
  // there. Blocks only to write the rows, and not where another thread is writing. Errors are those of the
  // file.
  absl::Status Write(std::int64_t step, absl::Time now, const Scalars& scalars) ABSL_LOCKS_EXCLUDED(mutex_);

  // Writes all rows that were added before; waits for another thread that is writing.
  absl::Status Flush() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  MetricsSink(std::unique_ptr<AppendFile> rows, std::unique_ptr<AppendFile> events,
              absl::Duration flush_interval, absl::Time now);
  // Writes what is pending. The caller has set writing_, which is cleared here.
  absl::Status WritePending() ABSL_LOCKS_EXCLUDED(mutex_);
  bool Idle() const ABSL_SHARED_LOCKS_REQUIRED(mutex_) { return !writing_; }

  // Touched by the thread that has set writing_, without the lock.
  const std::unique_ptr<AppendFile> rows_;
  const std::unique_ptr<AppendFile> events_;
  const absl::Duration flush_interval_;

  absl::Mutex mutex_;
  std::string pending_rows_ ABSL_GUARDED_BY(mutex_);
  std::string pending_events_ ABSL_GUARDED_BY(mutex_);
  absl::Time last_write_ ABSL_GUARDED_BY(mutex_);
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace dbr
