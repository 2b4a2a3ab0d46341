#include "deploy/report/curves.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>

#include "deploy/report/statistics.h"

namespace dbr::report {
namespace {

// One run's evaluations. A learner that was started again has passed some places twice: a later evaluation
// takes the place of those before it that are at its place or behind.
using Track = std::map<double, double>;

Track TrackOf(const RunSummary& summary, const std::string& opponent, Axis axis) {
  Track track;
  const std::vector<EvaluationPoint>& points = summary.curve.points();
  for (const EvaluationPoint& point : points) {
    if (point.opponent != (opponent.empty() ? points[0].opponent : opponent)) continue;
    const double x = static_cast<double>(axis == Axis::kUpdates ? point.updates : point.steps);
    const double y = std::isfinite(point.score_mean) ? point.score_mean : point.return_mean;
    if (!std::isfinite(y)) continue;
    track.erase(track.lower_bound(x), track.end());
    track[x] = y;
  }
  return track;
}

// Requires an x within the track.
double At(const Track& track, double x) {
  const auto above = track.lower_bound(x);
  if (above == track.end()) return track.rbegin()->second;
  if (above->first == x || above == track.begin()) return above->second;
  const auto below = std::prev(above);
  const double share = (x - below->first) / (above->first - below->first);
  return below->second + share * (above->second - below->second);
}

}  // namespace

Curve MakeCurve(const Runs& runs, int task, int contender, const std::string& opponent, Axis axis) {
  std::vector<Track> tracks;
  for (const ReportedCell& cell : runs.cells) {
    if (cell.task != task || cell.contender != contender || cell.state != ReportedState::kDone) continue;
    Track track = TrackOf(cell.summary, opponent, axis);
    if (!track.empty()) tracks.push_back(std::move(track));
  }
  Curve curve;
  if (tracks.empty()) return curve;
  double first = tracks[0].begin()->first, last = tracks[0].rbegin()->first;
  std::size_t points = 0;
  for (const Track& track : tracks) {
    first = std::max(first, track.begin()->first);
    last = std::min(last, track.rbegin()->first);
    points = std::max(points, track.size());
  }
  points = first < last ? std::min<std::size_t>(points, kPoints) : 1;
  if (first > last) return curve;
  curve.seeds = static_cast<int>(tracks.size());
  for (std::size_t i = 0; i < points; ++i) {
    const double x = points == 1 ? last : first + (last - first) * static_cast<double>(i) / (points - 1);
    std::vector<double> values;
    for (const Track& track : tracks) values.push_back(At(track, x));
    curve.x.push_back(x);
    curve.mean.push_back(Mean(values));
    curve.low.push_back(*std::min_element(values.begin(), values.end()));
    curve.high.push_back(*std::max_element(values.begin(), values.end()));
  }
  return curve;
}

}  // namespace dbr::report
