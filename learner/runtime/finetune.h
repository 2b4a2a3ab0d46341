// The way from the updates on the seed buffer alone to those with actors (FinetuneConfig).
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "core/safetensors.h"
#include "learner/algorithm.h"
#include "learner/metrics/metrics_sink.h"
#include "proto/config.pb.h"
#include "proto/policy.pb.h"
#include "replay/client/client.h"

namespace dbr {

// Knows the phase of a run, and what holds in it:
//
//   offline --- AwaitOfflineReturn, Decide ---> online, with the seed buffer (RETAIN) or without (WARM_START)
//
// The schedules are counted in updates from the end of the offline phase. Where an evaluation falls below the
// guard's share of the offline policy's return, they begin anew with the next update: the policy is held as
// closely as offline again. Observe and Close are for any thread, the others for the trainer's.
class Finetune {
 public:
  explicit Finetune(const Config& config);

  // Whether there is a way to go: an offline phase and a mode other than NONE.
  bool designed() const { return config_.mode() != FinetuneConfig::NONE; }
  // Whether the next update would be the first one online, and nothing is decided yet.
  bool IsBetweenPhases(std::uint64_t updates) const {
    return designed() && !decided_.has_value() && updates >= offline_updates_;
  }

  // Takes an evaluator's report.
  void Observe(const EvaluationReport& report);
  // Blocks until a report of the policy after `updates` has come, and returns its mean return; nullopt after
  // Close.
  std::optional<double> AwaitOfflineReturn(std::uint64_t updates);
  // Ends that wait.
  void Close();

  // The mean return of the seed buffer's whole episodes. Without one, AUTO takes RETAIN.
  void set_seed_buffer_return(double mean) { seed_buffer_return_ = mean; }
  // Decides how the run goes on from `updates` updates.
  void Decide(std::uint64_t updates, double offline_return);
  // What was decided, for people: a sentence without a full stop. Empty before that.
  std::string Text() const;

  // What draws ask of the replay server now.
  DrawTerms terms() const;
  // What holds in the update after `updates` updates. Looks at the reports first.
  UpdateControls ControlsAt(std::uint64_t updates);
  // The rows' values: how often the schedules have begun anew, and how far they are, from 0 to 1.
  Scalars Metrics() const;

  // For checkpoints. Load returns DataLoss where a value is missing.
  void Save(TensorFile* file) const;
  absl::Status Load(const TensorFile& file);

 private:
  // How far a schedule is, from 0 to 1.
  double Progress(const ScheduleConfig& schedule) const;
  std::optional<double> Geometric(const ScheduleConfig& schedule) const;
  std::optional<double> Linear(const ScheduleConfig& schedule) const;
  // The return below which the policy is held again.
  double GuardedReturn() const;

  const FinetuneConfig config_;
  const std::uint64_t offline_updates_;

  std::optional<FinetuneConfig::Mode> decided_;  // RETAIN or WARM_START
  double offline_return_ = 0;
  double seed_buffer_return_ = std::numeric_limits<double>::quiet_NaN();
  std::uint64_t begun_ = 0;  // the updates at which the schedules began, for the last time
  std::uint64_t begun_anew_ = 0;
  std::uint64_t updates_ = 0;  // of the newest ControlsAt

  absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<EvaluationReport> newest_ ABSL_GUARDED_BY(mutex_);  // that ControlsAt has not looked at
};

}  // namespace dbr
