// What a run came to, over all of its launches: the content of its summary file.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actor/evaluator.h"
#include "deploy/launch/evaluation_curve.h"
#include "deploy/launch/monitor.h"
#include "deploy/launch/run_state.h"

namespace dbr {

// The seed buffer that the replay server holds. `rows` is 0 where there is none.
struct SeedBufferSummary {
  std::string path;        // as the config has it
  std::uint64_t rows = 0;  // transitions that were loaded
  // Rows that were left out: a value is not finite, or a flag neither 0 nor 1.
  std::uint64_t bad_rows = 0;
  std::uint64_t episodes = 0;                                              // whole ones
  double return_mean = 0, return_std = 0, return_min = 0, return_max = 0;  // over the whole episodes
  double rows_per_second = 0;
  std::uint64_t actions_outside = 0;  // rows with an action outside [-1, 1]
};

// What a user should know of a seed buffer before it is trained on, a line each: that no episode ends in it,
// that actions lie outside the range.
std::vector<std::string> SeedBufferWarnings(const SeedBufferSummary& seed_buffer);

// What summary.json holds. Counters and evaluations go on over --resume. A copyable value.
struct RunSummary {
  std::string env;
  std::string algorithm;
  std::uint64_t seed = 0;
  std::string config;           // the file that the run was launched with
  std::string commit;           // that the newest launch's programs were built from (deploy/launch/commit.h)
  std::string matrix_products;  // what made the newest learner's; empty until it has told
  RunEnding ended = RunEnding::kNone;
  std::string failure;    // why a failed one failed
  double wall_s = 0;      // from the start of the processes to their end, over all launches of the run
  double training_s = 0;  // the part of it with everything up
  std::uint64_t launches = 0;
  std::uint64_t games = 0;        // episodes that ended
  std::uint64_t transitions = 0;  // that the actors made
  std::uint64_t updates = 0;
  std::uint64_t policy_version = 0;
  std::uint64_t restarts = 0;  // after a process died
  SeedBufferSummary seed_buffer;
  std::uint64_t offline_updates = 0;     // as the config asks
  EvaluationCurve curve;                 // during training
  std::uint64_t missed_evaluations = 0;  // that the learner dropped before the launcher asked for them
  std::uint64_t every_updates = 0;       // between evaluations, as the config asks; 0: by time
  std::vector<EvaluationResult> final_results;
  std::string final_policy;  // which one the final results are of: raw or average; empty until there are some

  // Takes over the counters of the newest answers, and returns the evaluations that are new.
  std::vector<EvaluationPoint> Update(const RunSample& sample);
  // The iterations without an evaluation: those that the evaluator skipped, and, once training has ended,
  // those that it had not come to. The last iteration does not count, for the final evaluation is of its
  // policy.
  std::set<std::uint64_t> SkippedIterations() const;
  // See EvaluationCurve; empty without an offline phase.
  std::optional<EvaluationPoint> AfterOffline() const;
};

// A run that came to a limit and has no final results was stopped in its final evaluation.
RunState StateOf(const RunSummary& summary);

}  // namespace dbr
