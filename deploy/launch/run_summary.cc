#include "deploy/launch/run_summary.h"

#include "absl/strings/str_cat.h"
#include "replay/dataset/dataset_facts.h"

namespace dbr {

std::vector<EvaluationPoint> RunSummary::Update(const RunSample& sample) {
  if (sample.replay.has_value()) {
    const StatsReply& replay = *sample.replay;
    games = replay.episodes();
    transitions = replay.inserted();
    seed_buffer.rows = replay.seed_buffer_rows();
    seed_buffer.bad_rows = replay.seed_buffer_bad_rows();
    seed_buffer.episodes = replay.seed_buffer_episodes();
    seed_buffer.return_mean = replay.seed_buffer_return_mean();
    seed_buffer.return_std = replay.seed_buffer_return_std();
    seed_buffer.return_min = replay.seed_buffer_return_min();
    seed_buffer.return_max = replay.seed_buffer_return_max();
    seed_buffer.rows_per_second = replay.seed_buffer_rows_per_second();
    seed_buffer.actions_outside = replay.seed_buffer_actions_outside();
  }
  if (sample.learner.has_value()) {
    updates = sample.learner->updates();
    policy_version = sample.learner->policy_version();
    if (!sample.learner->matrix_products().empty()) matrix_products = sample.learner->matrix_products();
  }
  return curve.Update(sample);
}

std::vector<std::string> SeedBufferWarnings(const SeedBufferSummary& seed_buffer) {
  std::vector<std::string> warnings =
      DataWarnings({seed_buffer.rows, seed_buffer.episodes, seed_buffer.actions_outside});
  for (std::string& warning : warnings) warning.insert(0, "warning: seed buffer: ");
  return warnings;
}

std::optional<EvaluationPoint> RunSummary::AfterOffline() const {
  return offline_updates > 0 ? curve.AfterOffline(offline_updates) : std::nullopt;
}

std::set<std::uint64_t> RunSummary::SkippedIterations() const {
  std::set<std::uint64_t> skipped = curve.skipped();
  if (every_updates == 0 || ended == RunEnding::kRunning) return skipped;
  const std::optional<std::uint64_t> last = curve.LastIteration();
  for (std::uint64_t k = last.has_value() ? *last + 1 : 0; k < updates / every_updates; ++k)
    skipped.insert(k);
  return skipped;
}

RunState StateOf(const RunSummary& summary) {
  switch (summary.ended) {
    case RunEnding::kNone:
      return RunState::kNotBegun;
    case RunEnding::kRunning:
      return RunState::kRunning;
    case RunEnding::kInterrupted:
      return RunState::kInterrupted;
    case RunEnding::kFailed:
      return RunState::kFailed;
    default:
      return summary.final_results.empty() ? RunState::kInterrupted : RunState::kDone;
  }
}

}  // namespace dbr
