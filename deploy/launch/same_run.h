// Whether two configs are of one run.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "proto/config.pb.h"

namespace dbr {

// InvalidArgument, naming every field that differs, unless a run of `before` can go on under `now`.
absl::Status CheckSameRun(const Config& before, const Config& now);

// The fields, limits and evaluation among them, by which what comes of a run of `now` could differ from what
// came of `before`: a line each, "modified: replay.capacity: 5000 -> 6000"; empty where there is none.
// Defaults count as if they were written out; addresses, threads, restarts, how often checkpoints are made
// and in which folder the seed buffer lies do not count.
std::string DifferencesOfOutcome(const Config& before, const Config& now);

}  // namespace dbr
