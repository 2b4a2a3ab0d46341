// How a launch watches over its run: progress, phases and limits.
#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/status_macros.h"
#include "deploy/launch/launch.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

constexpr absl::Duration kSummaryEvery = absl::Seconds(10);

double Missing(std::uint64_t limit, std::uint64_t now) {
  return static_cast<double>(limit) - static_cast<double>(std::min(limit, now));
}

}  // namespace

absl::Status Launch::Train() {
  while (supervisor_->stop_signals() == 0) {
    const absl::Time now = absl::Now();
    Observe(now);
    if (summary_.ended != RunEnding::kRunning) return absl::OkStatus();
    if (!acting_ && OfflinePhaseIsOver(monitor_->Latest())) {
      Say(absl::StrCat("offline phase over after ", WithCommas(summary_.updates), " updates: starting ",
                       plan_.actors, plan_.actors == 1 ? " actor" : " actors"));
      RETURN_IF_ERROR(StartActors());
    }
    const std::uint32_t limit = plan_.config.launch().max_seconds();
    absl::Time deadline = absl::InfiniteFuture();  // the monitor wakes us
    if (limit > 0) deadline = now + absl::Seconds(limit - summary_.training_s);
    RETURN_IF_ERROR(supervisor_->Wait(deadline));
  }
  summary_.ended = RunEnding::kInterrupted;
  return absl::OkStatus();
}

// Once transitions have come in there is no way back: a learner that starts again from an older checkpoint
// may need them.
bool Launch::OfflinePhaseIsOver(const RunSample& sample) const {
  if (plan_.actors == 0 || !sample.replay.has_value() || !sample.learner.has_value()) return false;
  return sample.replay->inserted() > 0 || sample.learner->updates() >= summary_.offline_updates;
}

void Launch::Observe(absl::Time now) {
  const RunSample sample = monitor_->Latest();
  if (!first_.replay.has_value()) first_.replay = sample.replay;
  const std::vector<EvaluationPoint> evaluations = summary_.Update(sample);
  summary_.training_s = before_.training_s + absl::ToDoubleSeconds(now - training_since_);
  summary_.restarts = before_.restarts + supervisor_->restarts();
  if (const auto limit = LimitReached(sample, evaluations)) summary_.ended = *limit;
  if (sample.replay.has_value()) {
    line_.Update({.sample = sample,
                  .left = TimeLeft(sample),
                  .scored = plan_.env.has_score,
                  .offline_updates = acting_ ? 0 : summary_.offline_updates},
                 now);
  }
  if (now - summary_saved_ < kSummaryEvery) return;
  summary_saved_ = now;
  SaveSummary();
}

std::optional<RunEnding> Launch::LimitReached(const RunSample& sample,
                                              const std::vector<EvaluationPoint>& evaluations) const {
  const LaunchConfig& limits = plan_.config.launch();
  if (limits.max_seconds() > 0 && summary_.training_s >= limits.max_seconds()) return RunEnding::kMaxSeconds;
  if (limits.max_episodes() > 0 && summary_.games >= limits.max_episodes()) return RunEnding::kMaxEpisodes;
  if (limits.max_steps() > 0 && summary_.transitions >= limits.max_steps()) return RunEnding::kMaxSteps;
  for (const EvaluationPoint& point : evaluations) {
    if (limits.stop_at_return() != 0 && point.return_mean >= limits.stop_at_return())
      return RunEnding::kStopAtReturn;
  }
  if (sample.learner.has_value() && sample.learner->finished()) return RunEnding::kMaxUpdates;
  return std::nullopt;
}

// Nothing is known of how fast actors will be while they do not act.
std::optional<absl::Duration> Launch::TimeLeft(const RunSample& sample) const {
  const LaunchConfig& limits = plan_.config.launch();
  std::optional<absl::Duration> left;
  const auto within = [&left](double seconds) {
    if (!left.has_value() || absl::Seconds(seconds) < *left) left = absl::Seconds(seconds);
  };
  if (limits.max_seconds() > 0) within(limits.max_seconds() - summary_.training_s);
  const double here = summary_.training_s - before_.training_s;
  if (limits.max_episodes() > 0 && first_.replay.has_value() && summary_.games > first_.replay->episodes()) {
    const double games_per_second = static_cast<double>(summary_.games - first_.replay->episodes()) / here;
    within(Missing(limits.max_episodes(), summary_.games) / games_per_second);
  }
  if (limits.max_steps() > 0 && sample.replay.has_value() && sample.replay->insert_rate() > 0)
    within(Missing(limits.max_steps(), summary_.transitions) / sample.replay->insert_rate());
  const std::uint64_t updates = plan_.config.learner().max_updates();
  if (updates > 0 && sample.learner.has_value() && sample.learner->updates_per_second() > 0)
    within(Missing(updates, summary_.updates) / sample.learner->updates_per_second());
  return left;
}

}  // namespace dbr
