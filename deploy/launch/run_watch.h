// What a launch knows of the run that it watches over.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "actor/evaluator.h"
#include "core/policy_snapshot.h"
#include "deploy/launch/monitor.h"
#include "deploy/launch/run_limits.h"
#include "deploy/launch/run_summary.h"
#include "proto/config.pb.h"

namespace dbr {

// Keeps the summary of a run up to date over one launch, from what the services answer and the times that it
// is told: it reads no clock and writes no file. One thread.
class RunWatch {
 public:
  // `summary`: what earlier launches of the run came to, with what this launch says of itself.
  RunWatch(const Config& config, RunSummary summary);

  const RunSummary& summary() const { return summary_; }
  const RunLimits& limits() const { return limits_; }

  void Start(absl::Time now);          // the processes start
  void StartTraining(absl::Time now);  // all of them serve

  // Takes over what the services count. The next Observe looks at its evaluations.
  void Count(const RunSample& sample);
  // Takes over what the learner has saved last.
  void CountSaved(const PolicySnapshot& policy);
  // In training: counts, and notes the limit that the run has come to, if any, as its ending. `restarts`: of
  // processes, in this launch.
  void Observe(const RunSample& sample, std::uint64_t restarts, absl::Time now);
  // Until the nearest limit, by the rates of this launch; empty: no limit, or not known yet. Nothing is known
  // of how fast actors will be while they do not act.
  std::optional<absl::Duration> TimeLeft(const RunSample& sample) const;

  // Takes the time since Start() into the summary.
  void CountWallTime(absl::Time now);
  // True once in ten seconds of training: the summary is to be saved.
  bool IsDueToBeSaved(absl::Time now);

  void Interrupt() { summary_.ended = RunEnding::kInterrupted; }
  void Fail(const absl::Status& why);
  // `policy`: which one played, as summary.json names it.
  void SetFinalResults(std::vector<EvaluationResult> results, std::string policy);

 private:
  const RunLimits limits_;
  const RunSummary before_;  // this launch
  RunSummary summary_;
  std::vector<EvaluationPoint> unseen_;  // evaluations that no limit has been looked up for
  absl::Time started_ = absl::InfiniteFuture();
  absl::Time training_since_ = absl::InfiniteFuture();
  absl::Time saved_ = absl::InfinitePast();
  std::optional<std::uint64_t> first_episodes_;  // that the replay server counted when it was first heard
};

}  // namespace dbr
