// What a run came to: its summary file.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "actor/evaluator.h"
#include "core/run_folder.h"
#include "deploy/launch/evaluation_curve.h"
#include "deploy/launch/monitor.h"

namespace dbr {

// {env, opponent, episodes, seed, score: {mean, stderr}, return: {mean, stderr}}, and where there is no score
// also return.{std, min, max} and steps.mean; null for what is not a number.
nlohmann::ordered_json ToJson(const EvaluationResult& result);

// Where the table stands in a run's folder.
std::string ResultsPath(const RunFolder& folder);

// Of the seed that the replay server holds; `path` as the config has it.
struct SeedBufferSummary {
  std::string path;
  std::uint64_t rows = 0, bad_rows = 0, episodes = 0;
  double return_mean = 0, return_std = 0, return_min = 0, return_max = 0;
  double rows_per_second = 0;
};

// What summary.json holds. Counters and evaluations go on over --resume.
struct RunSummary {
  std::string env;
  std::string algorithm;
  std::uint64_t seed = 0;
  std::string config;  // the file that the run was launched with
  std::string commit;  // of the newest launch's programs (deploy/launch/commit.h)
  // running, max_episodes, max_steps, max_seconds, max_updates, stop_at_return, interrupted or failed
  std::string ended;
  std::string failure;    // of a failed one
  double wall_s = 0;      // from the start of the processes, over all launches of the run
  double training_s = 0;  // of that, with everything up
  std::uint64_t launches = 0;
  std::uint64_t games = 0;        // episodes that ended
  std::uint64_t transitions = 0;  // of the actors
  std::uint64_t updates = 0;
  std::uint64_t policy_version = 0;
  std::uint64_t restarts = 0;  // of processes that died
  SeedBufferSummary seed_buffer;
  std::uint64_t offline_updates = 0;  // that the config asks for
  EvaluationCurve curve;              // during training
  std::uint64_t every_updates = 0;    // of evaluations, that the config asks for; 0: by time
  std::vector<EvaluationResult> final_results;

  // Takes over the counters of the newest answers, and gives the evaluations that are new.
  std::vector<EvaluationPoint> Update(const RunSample& sample);
  // The iterations that no evaluation was made of: those that the evaluator skipped, and once training has
  // ended those that it had not come to, but for the last one, whose policy the final evaluation is of.
  std::set<std::uint64_t> SkippedIterations() const;
  // See EvaluationCurve; empty without an offline phase.
  std::optional<EvaluationPoint> AfterOffline() const;
};

absl::Status WriteSummary(const RunSummary& summary, const RunFolder& folder);

// What an earlier launch wrote, but for its seed buffer; zeros where there is no readable summary.
RunSummary ReadSummary(const RunFolder& folder);

}  // namespace dbr
