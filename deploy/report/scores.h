// The rows of the report's table: what each contender's runs came to on each measure of each task.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "deploy/report/cells.h"
#include "deploy/report/statistics.h"

namespace dbr::report {

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// One contender's runs on one row. Figures that its runs do not carry are NaN.
struct Sample {
  std::vector<double> values;  // the final mean of each run that is done, by seed
  double mean = kNoNumber;
  double std = kNoNumber;  // over seeds; NaN for one
  double iqm = kNoNumber;
  Interval interval = {kNoNumber, kNoNumber};  // 95%, of the IQM; NaN for one seed
  std::array<int, 5> cells = {};               // how many are in each ReportedState

  int count(ReportedState state) const { return cells[static_cast<int>(state)]; }
  int all() const;  // cells that there should be; 0: the contender does not take part
};

struct Row {
  int task = -1;  // index in the grid; -1: over several tasks
  Measure measure;
  bool score = false;           // its values are scores of games, in [0, 1]; else returns of episodes
  std::vector<Sample> samples;  // one for each contender of the grid
};

// The rows of all tasks, in the grid's order. The bootstrap's resamples depend on the row and the contender
// alone.
std::vector<Row> MakeRows(const Runs& runs);

// The row over all tasks that are scored in [0, 1]; empty where they have fewer than two rows. A run's value
// is the mean of its scores, and the strata of the bootstrap are the tasks. Contenders with no finished run
// in one of the tasks have no figure. Returns of different tasks have no common scale: there is no such row
// of them.
std::optional<Row> OverAllScores(const Runs& runs, const std::vector<Row>& rows);

// The mean that the run's final evaluation gives for the measure; NaN where it has none.
double FinalMean(const ReportedCell& cell, const Measure& measure);

// What was published of a contender, or null. The pointer lives as long as `measure`.
const Published* PublishedOf(const Measure& measure, const std::string& contender);

// "1149.2"; a score with three digits after the point, a return with one.
std::string FigureText(const Row& row, double value);
// "1149.2 ± 12.1", "1149.2 (one seed)", or where no run is done what its cells are: "2 running, 3 not run";
// "–" for one that does not take part.
std::string MeanText(const Row& row, const Sample& sample);
// "1150.0 [1140.1, 1160.2]"; "–" for fewer than two seeds.
std::string IqmText(const Row& row, const Sample& sample);
// "3", or where some of its cells are not done "3 of 5: 1 running, 1 not run".
std::string SeedsText(const Sample& sample);
// "-1539 ± 8.2", as it was printed.
std::string PublishedText(const Published* published);

// The index of the sample with the greatest mean among those given; -1 where none has one.
int BestOf(const Row& row, const std::vector<int>& contenders);

}  // namespace dbr::report
