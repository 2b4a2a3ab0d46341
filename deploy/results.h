// The table at the end of a run, and the run's summary file.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "actor/evaluator.h"
#include "core/run_folder.h"
#include "deploy/monitor.h"

namespace dbr {

// Scores (returns where the environment has none) with standard errors; for Connect-4 with the paper's
// figures beside.
std::string ResultTable(absl::Span<const EvaluationResult> results);

// {env, opponent, episodes, seed, score: {mean, stderr}, return: {mean, stderr}}; null for what is not a
// number.
nlohmann::ordered_json ToJson(const EvaluationResult& result);

// Where the table stands in a run's folder.
std::string ResultsPath(const RunFolder& folder);

// What summary.json holds. Counters go on over --resume.
struct RunSummary {
  std::string env;
  std::string algorithm;
  std::uint64_t seed = 0;
  std::string config;     // the file that the run was launched with
  std::string ended;      // running, max_episodes, max_seconds, max_updates, interrupted or failed
  std::string failure;    // of a failed one
  double wall_s = 0;      // from the start of the processes, over all launches of the run
  double training_s = 0;  // of that, with everything up
  std::uint64_t launches = 0;
  std::uint64_t games = 0;  // episodes that ended
  std::uint64_t transitions = 0;
  std::uint64_t updates = 0;
  std::uint64_t policy_version = 0;
  std::uint64_t restarts = 0;                 // of processes that died
  std::vector<EvaluationReport> evaluations;  // the newest of each opponent during training
  std::vector<EvaluationResult> final_results;

  // Takes over the counters of the newest answers.
  void Update(const RunSample& sample);
};

absl::Status WriteSummary(const RunSummary& summary, const RunFolder& folder);

// The times and counters of an earlier launch; zeros where there is no readable summary.
RunSummary ReadSummary(const RunFolder& folder);

}  // namespace dbr
