// Learning curves over the seeds of a contender.
#pragma once

#include <string>
#include <vector>

#include "deploy/report/cells.h"

namespace dbr::report {

// The mean, the least and the greatest value over the seeds, at each x.
struct Curve {
  std::vector<double> x, mean, low, high;
  int seeds = 0;
};

// What a curve is drawn over.
enum class Axis { kUpdates, kSteps };

// The curve of the contender's finished runs on the task against `opponent` (empty: the first that was
// evaluated): of scores where there are any, else of mean returns. It is read off at kPoints places, or at as
// many as the longest run was evaluated at where they are fewer. The places are spread evenly over the
// stretch that all seeds share, and between evaluations the curve is straight. It has no points where there
// is nothing to draw.
inline constexpr int kPoints = 120;
Curve MakeCurve(const Runs& runs, int task, int contender, const std::string& opponent, Axis axis);

}  // namespace dbr::report
