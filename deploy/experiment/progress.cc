#include "deploy/experiment/progress.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

// A limit of a run, and how near it is.
struct Limit {
  double now = 0;
  double end = 0;  // 0: no such limit
  const char* unit = "";

  double fraction() const { return end > 0 ? std::min(1.0, now / end) : 0; }
};

Limit NearestLimit(const Config& config, const RunSummary& summary) {
  const LaunchConfig& launch = config.launch();
  const auto number = [](std::uint64_t value) { return static_cast<double>(value); };
  const std::array<Limit, 4> limits = {
      Limit{number(summary.updates), number(config.learner().max_updates()), " updates"},
      Limit{number(summary.transitions), number(launch.max_steps()), " steps"},
      Limit{number(summary.games), number(launch.max_episodes()), " episodes"},
      Limit{summary.training_s, number(launch.max_seconds()), " s"}};
  // The first of those that are as near and are limits at all.
  return *std::max_element(limits.begin(), limits.end(), [](const Limit& a, const Limit& b) {
    return std::pair(a.fraction(), a.end > 0) < std::pair(b.fraction(), b.end > 0);
  });
}

std::string Phase(const Config& config, const RunSummary& summary) {
  if (summary.ended == RunEnding::kInterrupted) return "saving";
  if (summary.ended != RunEnding::kRunning) return "evaluating";
  if (config.learner().offline_updates() == 0) return "training";
  return summary.updates < config.learner().offline_updates() && summary.transitions == 0 ? "offline"
                                                                                          : "online";
}

std::string Newest(const RunSummary& summary) {
  if (summary.curve.points().empty()) return "";
  const EvaluationPoint& point = summary.curve.points().back();
  if (std::isfinite(point.score_mean)) return absl::StrCat(point.opponent, " ", Fixed(point.score_mean, 2));
  return absl::StrCat("return ", Fixed(point.return_mean, 1));
}

std::array<std::string, 3> Kinds(const Cell& cell) {
  return {absl::StrCat(cell.task, "/", cell.contender), cell.task, absl::StrCat("/", cell.kind)};
}

}  // namespace

CellProgress ProgressOf(const Config& config, const RunSummary& summary) {
  CellProgress progress;
  if (summary.ended == RunEnding::kNone) {
    progress.phase = "starting";
    return progress;
  }
  const Limit limit = NearestLimit(config, summary);
  progress.phase = Phase(config, summary);
  progress.fraction = limit.fraction();
  progress.amount = absl::StrCat(WithCommas(static_cast<std::uint64_t>(limit.now)), " of ",
                                 WithCommas(static_cast<std::uint64_t>(limit.end)), limit.unit);
  progress.newest = Newest(summary);
  if (progress.fraction > 0)
    progress.left = absl::Seconds(summary.training_s * (1 - progress.fraction) / progress.fraction);
  return progress;
}

void CellDurations::Add(const Cell& cell, absl::Duration whole) {
  for (const std::string& kind : Kinds(cell)) {
    sums_[kind].total += whole;
    ++sums_[kind].count;
  }
}

std::optional<absl::Duration> CellDurations::Expected(const Cell& cell) const {
  for (const std::string& kind : Kinds(cell)) {
    const auto found = sums_.find(kind);
    if (found != sums_.end()) return found->second.total / found->second.count;
  }
  return std::nullopt;
}

}  // namespace dbr
