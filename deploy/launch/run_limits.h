// The limits at which the config ends a run, and how near they are.
#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "absl/types/span.h"
#include "deploy/launch/evaluation_curve.h"
#include "deploy/launch/monitor.h"
#include "deploy/launch/run_summary.h"
#include "proto/config.pb.h"

namespace dbr {

// How fast a run goes; 0: not known.
struct RunRates {
  double episodes_per_second = 0;
  double steps_per_second = 0;  // transitions of the actors
  double updates_per_second = 0;
};

// Knows the config alone: no clock, no file, no state. Thread-safe.
class RunLimits {
 public:
  explicit RunLimits(const Config& config) : config_(config) {}

  // Whether the run comes to an end by itself, however good its policies are.
  bool any() const;

  // What ends the run, for people: "1:00:00 or 500 games"; "it is stopped" where nothing does. `episodes` is
  // what the environment's episodes are called.
  std::string Text(absl::string_view episodes) const;

  // The first limit that the run has come to; empty where it goes on. `fresh`: the evaluations that were not
  // there when this was asked before. `finished`: the learner says that it has made all of its updates.
  std::optional<RunEnding> Reached(const RunSummary& summary, absl::Span<const EvaluationPoint> fresh,
                                   bool finished) const;

  // When training that goes on from `now` comes to max_seconds; never without that limit.
  absl::Time Deadline(const RunSummary& summary, absl::Time now) const;

  // How long training takes to the nearest of the limits that the rates tell of; empty where none is known.
  std::optional<absl::Duration> TimeLeft(const RunSummary& summary, const RunRates& rates) const;

  // Whether actors are to start: the updates on the seed buffer alone are made, or actors have acted before.
  // Once transitions have come in there is no way back: a learner that starts again from an older checkpoint
  // may need them. False for a run without actors, and while a service has not answered.
  bool OfflinePhaseIsOver(const RunSample& sample) const;

 private:
  const Config config_;
};

}  // namespace dbr
