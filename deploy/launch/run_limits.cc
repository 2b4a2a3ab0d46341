#include "deploy/launch/run_limits.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "deploy/terminal/terminal.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

double Missing(std::uint64_t limit, std::uint64_t now) {
  return static_cast<double>(limit) - static_cast<double>(std::min(limit, now));
}

}  // namespace

bool RunLimits::any() const {
  const LaunchConfig& limits = config_.launch();
  return config_.learner().max_updates() > 0 || limits.max_episodes() > 0 || limits.max_steps() > 0 ||
         limits.max_seconds() > 0;
}

std::string RunLimits::Text(absl::string_view episodes) const {
  const LaunchConfig& limits = config_.launch();
  std::vector<std::string> until;
  if (limits.max_seconds() > 0) until.push_back(Clock(absl::Seconds(limits.max_seconds())));
  if (limits.max_episodes() > 0)
    until.push_back(absl::StrCat(WithCommas(limits.max_episodes()), " ", episodes));
  if (limits.max_steps() > 0) until.push_back(absl::StrCat(WithCommas(limits.max_steps()), " online steps"));
  const std::uint64_t updates = config_.learner().max_updates();
  if (updates > 0) until.push_back(absl::StrCat(WithCommas(updates), " updates"));
  if (limits.stop_at_return() != 0)
    until.push_back(absl::StrCat("an evaluated return of ", limits.stop_at_return()));
  return until.empty() ? "it is stopped" : absl::StrJoin(until, " or ");
}

std::optional<RunEnding> RunLimits::Reached(const RunSummary& summary,
                                            absl::Span<const EvaluationPoint> fresh, bool finished) const {
  const LaunchConfig& limits = config_.launch();
  if (limits.max_seconds() > 0 && summary.training_s >= limits.max_seconds()) return RunEnding::kMaxSeconds;
  if (limits.max_episodes() > 0 && summary.games >= limits.max_episodes()) return RunEnding::kMaxEpisodes;
  if (limits.max_steps() > 0 && summary.transitions >= limits.max_steps()) return RunEnding::kMaxSteps;
  for (const EvaluationPoint& point : fresh) {
    if (limits.stop_at_return() != 0 && point.return_mean >= limits.stop_at_return())
      return RunEnding::kStopAtReturn;
  }
  return finished ? std::optional(RunEnding::kMaxUpdates) : std::nullopt;
}

absl::Time RunLimits::Deadline(const RunSummary& summary, absl::Time now) const {
  const std::uint32_t limit = config_.launch().max_seconds();
  return limit > 0 ? now + absl::Seconds(limit - summary.training_s) : absl::InfiniteFuture();
}

std::optional<absl::Duration> RunLimits::TimeLeft(const RunSummary& summary, const RunRates& rates) const {
  std::optional<absl::Duration> left;
  const auto within = [&left](double seconds) {
    if (!left.has_value() || absl::Seconds(seconds) < *left) left = absl::Seconds(seconds);
  };
  const auto count = [&within](std::uint64_t limit, std::uint64_t now, double rate) {
    if (limit > 0 && rate > 0) within(Missing(limit, now) / rate);
  };
  const LaunchConfig& limits = config_.launch();
  if (limits.max_seconds() > 0) within(limits.max_seconds() - summary.training_s);
  count(limits.max_episodes(), summary.games, rates.episodes_per_second);
  count(limits.max_steps(), summary.transitions, rates.steps_per_second);
  count(config_.learner().max_updates(), summary.updates, rates.updates_per_second);
  return left;
}

bool RunLimits::OfflinePhaseIsOver(const RunSample& sample) const {
  if (TrainsOfflineAlone(config_) || !sample.replay.has_value() || !sample.learner.has_value()) return false;
  return sample.replay->inserted() > 0 || sample.learner->updates() >= config_.learner().offline_updates();
}

}  // namespace dbr
