// Reads a grid of runs. Thread-safe: pure functions.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "proto/experiment.pb.h"

namespace dbr {

// Reads a text-format Experiment. Blocks for LoadExperiment's reading of the file. Returns InvalidArgument
// with ALL errors in its text, as LoadConfig does: unknown fields with line, column and the nearest known
// name, values of another type, and fields out of bounds with path, bounds and value. LoadExperiment also
// returns ReadTextFile's errors. The user of the grid checks that it makes sense (deploy/experiment/check.h).
absl::StatusOr<Experiment> LoadExperiment(const std::string& path);
absl::StatusOr<Experiment> ParseExperiment(absl::string_view text);

}  // namespace dbr
