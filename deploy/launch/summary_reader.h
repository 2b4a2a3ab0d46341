// Reading a run's summary file back.
#pragma once

#include "absl/status/statusor.h"
#include "core/run_folder.h"
#include "deploy/launch/run_summary.h"

namespace dbr {

// What WriteSummary wrote (deploy/launch/results.h); a figure that is absent, null or of another type is 0 or
// NaN, as RunSummary has it for none. NotFound where there is no file; DataLoss, naming it, where it is no
// JSON object or does not say how the run ended.
absl::StatusOr<RunSummary> LoadSummary(const RunFolder& folder);

// What an earlier launch wrote, but for its seed buffer, of which the next launch's replay server tells anew;
// zeros where there is no readable summary.
RunSummary ReadSummary(const RunFolder& folder);

}  // namespace dbr
