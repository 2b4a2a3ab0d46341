// Whether two configs are of one run, and whether they come to the same.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "proto/config.pb.h"

namespace dbr {

// InvalidArgument, naming every field that differs, unless a run of `before` can go on under `now`.
absl::Status CheckSameRun(const Config& before, const Config& now);

// What of a config decides what comes of a run: `config` with its defaults filled in (WithDefaults), and with
// the fields that change nothing at their defaults. Those are addresses and whether they may be insecure,
// threads, restarts, how often checkpoints are made and how many are kept, and the folder of the seed buffer
// (the name of its file counts). Runs whose OutcomeConfigs differ in the random seed alone may be averaged.
Config OutcomeConfig(const Config& config);

// The fields in which the OutcomeConfigs of two configs differ, limits and evaluation among them: a line
// each, "modified: replay.capacity: 5000 -> 6000"; empty where there is none.
std::string DifferencesOfOutcome(const Config& before, const Config& now);

}  // namespace dbr
