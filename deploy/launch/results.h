// Writing what a run came to: its summary file, and single results as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "absl/status/status.h"
#include "actor/evaluator.h"
#include "core/run_folder.h"
#include "deploy/launch/run_summary.h"

namespace dbr {

// {env, opponent, episodes, seed, score: {mean, stderr}, return: {mean, stderr}}, and where there is no score
// also return.{std, min, max} and steps.mean; null for what is not a number.
nlohmann::ordered_json ToJson(const EvaluationResult& result);

// Where the table of the final results stands in a run's folder.
std::string ResultsPath(const RunFolder& folder);

// Replaces the folder's summary.json in one step. Errors of WriteFileAtomically.
absl::Status WriteSummary(const RunSummary& summary, const RunFolder& folder);

}  // namespace dbr
