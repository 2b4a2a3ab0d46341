// Reading a grid of runs.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "proto/experiment.pb.h"

namespace dbr {

// Reads a text-format Experiment. InvalidArgument lists ALL that is wrong with its text, as LoadConfig does:
// unknown fields with line and column and the nearest known name, values of another type, and fields out of
// bounds with path, bounds and value. Whether the grid makes sense is for its user to check
// (deploy/experiment/check.h).
absl::StatusOr<Experiment> LoadExperiment(const std::string& path);
absl::StatusOr<Experiment> ParseExperiment(absl::string_view text);

}  // namespace dbr
