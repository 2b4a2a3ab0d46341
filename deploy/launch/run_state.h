// How far a run has come.
#pragma once

#include <optional>

#include "absl/strings/string_view.h"

namespace dbr {

// What the newest launch of a run says of its end: "ended" in summary.json.
enum class RunEnding {
  kNone,         // no launch has said anything yet
  kRunning,      // the launch is at work, or was killed
  kInterrupted,  // a signal stopped it, and it saved everything
  kFailed,
  // The others are limits of the config, which end the training; the final evaluation follows.
  kMaxSeconds,
  kMaxEpisodes,
  kMaxSteps,
  kMaxUpdates,
  kStopAtReturn,
};

// The text of an ending in summary.json: "running", "interrupted", "failed" or the limit's name in the
// config, for example "max_seconds"; empty for kNone.
absl::string_view TextOf(RunEnding ending);

// The ending that has this text; empty where none has.
std::optional<RunEnding> ParseRunEnding(absl::string_view text);

// What a run has come to over all of its launches. StateOf (deploy/launch/run_summary.h) tells it.
enum class RunState {
  kNotBegun,
  kRunning,      // a launch is at work, or was killed
  kInterrupted,  // stopped by a signal, in training or in the final evaluation
  kFailed,
  kDone,  // came to a limit of its config and through its final evaluation
};

}  // namespace dbr
