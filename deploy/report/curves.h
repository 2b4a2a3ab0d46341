// Learning curves over the seeds of a contender.
#pragma once

#include <string>
#include <vector>

#include "deploy/report/cells.h"

namespace dbr::report {

// x, and over the seeds the mean, the least and the greatest value there.
struct Curve {
  std::vector<double> x, mean, low, high;
  int seeds = 0;
};

// What a curve is drawn over.
enum class Axis { kUpdates, kSteps };

// Of the contender's finished runs on the task, against `opponent` (empty: the first that was evaluated):
// scores where there are any, else mean returns. A curve is read off at kPoints places or at as many as the
// longest run was evaluated at, whichever are fewer, spread evenly over the stretch that all seeds share,
// between evaluations on a straight line. No points where there is nothing to draw.
inline constexpr int kPoints = 120;
Curve MakeCurve(const Runs& runs, int task, int contender, const std::string& opponent, Axis axis);

}  // namespace dbr::report
