#include "deploy/launch/evaluation_curve.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace dbr {

EvaluationCurve::EvaluationCurve(std::vector<EvaluationPoint> earlier, std::set<std::uint64_t> skipped)
    : points_(std::move(earlier)), skipped_(std::move(skipped)) {
  for (const EvaluationPoint& point : points_)
    known_.emplace(point.policy_version, point.updates, point.opponent);
}

std::vector<EvaluationPoint> EvaluationCurve::Update(const RunSample& sample) {
  Remember(sample);
  std::vector<EvaluationPoint> fresh;
  for (const EvaluationReport& report : sample.reports) {
    skipped_.insert(report.skipped_iterations().begin(), report.skipped_iterations().end());
    if (!known_.emplace(report.policy_version(), report.updates(), report.opponent()).second) continue;
    fresh.push_back({.opponent = report.opponent(),
                     .policy_version = report.policy_version(),
                     .updates = report.updates(),
                     .steps = StepsAt(report.updates()),
                     .episodes = report.episodes(),
                     .score_mean = report.score_mean(),
                     .score_stderr = report.score_stderr(),
                     .return_mean = report.return_mean(),
                     .return_std = report.return_stderr() * std::sqrt(static_cast<double>(report.episodes())),
                     .iteration = report.has_iteration() ? std::optional(report.iteration()) : std::nullopt});
  }
  points_.insert(points_.end(), fresh.begin(), fresh.end());
  return fresh;
}

void EvaluationCurve::Remember(const RunSample& sample) {
  if (!sample.replay.has_value() || !sample.learner.has_value()) return;
  const Moment now{sample.learner->updates(), sample.replay->inserted()};
  // A learner that went back to a checkpoint makes its updates again.
  while (!moments_.empty() && moments_.back().updates > now.updates) moments_.pop_back();
  // A policy is made when its updates are: while the learner waits, the first moment stays.
  if (!moments_.empty() && moments_.back().updates == now.updates) return;
  moments_.push_back(now);
  if (moments_.size() > kMoments) moments_.pop_front();
}

std::uint64_t EvaluationCurve::StepsAt(std::uint64_t updates) const {
  const auto after =
      std::lower_bound(moments_.begin(), moments_.end(), updates,
                       [](const Moment& moment, std::uint64_t value) { return moment.updates < value; });
  if (after == moments_.end()) return moments_.empty() ? 0 : moments_.back().steps;
  if (after == moments_.begin() || after->updates == updates) return after->steps;
  const Moment before = *std::prev(after);
  const double share =
      static_cast<double>(updates - before.updates) / static_cast<double>(after->updates - before.updates);
  return before.steps + static_cast<std::uint64_t>(share * static_cast<double>(after->steps - before.steps));
}

std::optional<std::uint64_t> EvaluationCurve::LastIteration() const {
  std::optional<std::uint64_t> last;
  for (const EvaluationPoint& point : points_) last = std::max(last, point.iteration);
  return last;
}

std::optional<EvaluationPoint> EvaluationCurve::AfterOffline(std::uint64_t offline_updates) const {
  std::optional<EvaluationPoint> last_offline, first_after;
  for (const EvaluationPoint& point : points_) {
    if (point.steps == 0) {
      last_offline = point;
    } else if (point.updates >= offline_updates && !first_after.has_value()) {
      first_after = point;
    }
  }
  const bool recent =
      last_offline.has_value() && last_offline->updates >= offline_updates - offline_updates / 10;
  return recent || !first_after.has_value() ? last_offline : first_after;
}

std::optional<EvaluationPoint> EvaluationCurve::LowestOnline() const {
  std::optional<EvaluationPoint> lowest;
  for (const EvaluationPoint& point : points_) {
    if (point.steps > 0 && (!lowest.has_value() || point.return_mean < lowest->return_mean)) lowest = point;
  }
  return lowest;
}

}  // namespace dbr
