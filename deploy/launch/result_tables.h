// The tables at the end of a run.
#pragma once

#include <string>

#include "absl/types/span.h"
#include "actor/evaluator.h"
#include "deploy/launch/run_summary.h"

namespace dbr {

// Final results of one environment: scores with standard errors, and beside them what was published of the
// environment (EnvPresentation); where it has no score, mean, spread, least and greatest return, and the mean
// number of steps.
std::string ResultTable(absl::Span<const EvaluationResult> results);

// The mean returns of the seed buffer, after the offline phase, at the lowest point online and at the end;
// empty for a run without a seed buffer.
std::string ReturnsTable(const RunSummary& summary);

}  // namespace dbr
