// The tables at the end of a run.
#pragma once

#include <string>

#include "absl/types/span.h"
#include "actor/evaluator.h"
#include "deploy/launch/run_summary.h"

namespace dbr {

// Scores with standard errors, for Connect-4 with the paper's figures beside; where the environment has no
// score, mean, spread, least and greatest return, and the mean number of steps.
std::string ResultTable(absl::Span<const EvaluationResult> results);

// The mean returns of the seed, after the offline phase, at the lowest point online and at the end; empty for
// a run without a seed.
std::string ReturnsTable(const RunSummary& summary);

}  // namespace dbr
