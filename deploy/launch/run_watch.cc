#include "deploy/launch/run_watch.h"

#include <string>
#include <utility>

namespace dbr {
namespace {

constexpr absl::Duration kSummaryEvery = absl::Seconds(10);

}  // namespace

RunWatch::RunWatch(const Config& config, RunSummary summary)
    : limits_(config), before_(summary), summary_(std::move(summary)) {}

void RunWatch::Start(absl::Time now) {
  started_ = now;
}

void RunWatch::StartTraining(absl::Time now) {
  training_since_ = now;
}

void RunWatch::Count(const RunSample& sample) {
  const std::vector<EvaluationPoint> fresh = summary_.Update(sample);
  summary_.missed_evaluations = before_.missed_evaluations + sample.missed_reports;
  unseen_.insert(unseen_.end(), fresh.begin(), fresh.end());
}

void RunWatch::CountSaved(const PolicySnapshot& policy) {
  summary_.updates = policy.updates;
  summary_.policy_version = policy.version;
}

void RunWatch::Observe(const RunSample& sample, std::uint64_t restarts, absl::Time now) {
  if (!first_episodes_.has_value() && sample.replay.has_value()) first_episodes_ = sample.replay->episodes();
  Count(sample);
  const std::vector<EvaluationPoint> fresh = std::exchange(unseen_, {});
  summary_.training_s = before_.training_s + absl::ToDoubleSeconds(now - training_since_);
  summary_.restarts = before_.restarts + restarts;
  const bool finished = sample.learner.has_value() && sample.learner->finished();
  if (const auto limit = limits_.Reached(summary_, fresh, finished)) summary_.ended = *limit;
}

std::optional<absl::Duration> RunWatch::TimeLeft(const RunSample& sample) const {
  RunRates rates;
  const double here = summary_.training_s - before_.training_s;
  if (first_episodes_.has_value() && summary_.games > *first_episodes_)
    rates.episodes_per_second = static_cast<double>(summary_.games - *first_episodes_) / here;
  if (sample.replay.has_value()) rates.steps_per_second = sample.replay->insert_rate();
  if (sample.learner.has_value()) rates.updates_per_second = sample.learner->updates_per_second();
  return limits_.TimeLeft(summary_, rates);
}

void RunWatch::CountWallTime(absl::Time now) {
  summary_.wall_s = before_.wall_s + absl::ToDoubleSeconds(now - started_);
}

bool RunWatch::IsDueToBeSaved(absl::Time now) {
  if (now - saved_ < kSummaryEvery) return false;
  saved_ = now;
  return true;
}

void RunWatch::Fail(const absl::Status& why) {
  summary_.ended = RunEnding::kFailed;
  summary_.failure = std::string(why.message());
}

void RunWatch::SetFinalResults(std::vector<EvaluationResult> results, std::string policy) {
  summary_.final_results = std::move(results);
  summary_.final_policy = std::move(policy);
}

}  // namespace dbr
