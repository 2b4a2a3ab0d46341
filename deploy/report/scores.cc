#include "deploy/report/scores.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "deploy/report/grid.h"
#include "deploy/terminal/terminal.h"

namespace dbr::report {
namespace {

constexpr ReportedState kUnfinished[] = {ReportedState::kFailed, ReportedState::kStopped,
                                         ReportedState::kRunning, ReportedState::kNotRun};
constexpr std::uint64_t kBootstrapSeed = 1;

const EvaluationResult* FinalOf(const ReportedCell& cell, const Measure& measure) {
  for (const EvaluationResult& result : cell.summary.final_results) {
    if (measure.opponent().empty() || result.opponent == measure.opponent()) return &result;
  }
  return nullptr;
}

Row EmptyRow(const Runs& runs, int task, Measure measure) {
  Row row;
  row.task = task;
  row.measure = std::move(measure);
  row.samples.resize(runs.grid.contender_size());
  return row;
}

void Summarise(const std::vector<std::vector<double>>& strata, Rng rng, Sample* sample) {
  sample->mean = Mean(sample->values);
  sample->std = SampleStd(sample->values);
  sample->iqm = InterquartileMean(sample->values);
  sample->interval = StratifiedBootstrap(strata, rng);
}

Row MakeRow(const Runs& runs, int task, const Measure& measure, std::uint64_t stream) {
  Row row = EmptyRow(runs, task, measure);
  row.score = runs.grid.task(task).kind() == Task::GAMES;
  for (const ReportedCell& cell : runs.cells) {
    if (cell.task != task) continue;
    Sample& sample = row.samples[cell.contender];
    const double value = FinalMean(cell, measure);
    // An evaluation that lacks this opponent has ended before this figure.
    const bool short_of_it = cell.state == ReportedState::kDone && !std::isfinite(value);
    ++sample.cells[static_cast<int>(short_of_it ? ReportedState::kStopped : cell.state)];
    if (std::isfinite(value)) sample.values.push_back(value);
  }
  const Rng rng = Rng(kBootstrapSeed).Fork(stream);
  for (std::size_t c = 0; c < row.samples.size(); ++c)
    Summarise({row.samples[c].values}, rng.Fork(c), &row.samples[c]);
  return row;
}

// The mean score of each finished run, by task and contender.
using Strata = std::map<std::pair<int, int>, std::vector<double>>;

Strata RunsOfScores(const Runs& runs, const std::vector<Row>& rows) {
  Strata strata;
  for (const ReportedCell& cell : runs.cells) {
    std::vector<double> scores;
    for (const Row& row : rows) {
      if (row.score && row.task == cell.task) scores.push_back(FinalMean(cell, row.measure));
    }
    const double mean = Mean(scores);
    if (std::isfinite(mean)) strata[{cell.task, cell.contender}].push_back(mean);
  }
  return strata;
}

std::string Unfinished(const Sample& sample) {
  std::vector<std::string> parts;
  for (const ReportedState state : kUnfinished) {
    if (sample.count(state) > 0) parts.push_back(absl::StrCat(sample.count(state), " ", NameOf(state)));
  }
  return absl::StrJoin(parts, ", ");
}

}  // namespace

int Sample::all() const {
  return std::accumulate(cells.begin(), cells.end(), 0);
}

double FinalMean(const ReportedCell& cell, const Measure& measure) {
  const EvaluationResult* result = cell.state == ReportedState::kDone ? FinalOf(cell, measure) : nullptr;
  if (result == nullptr) return kNoNumber;
  return std::isfinite(result->score_mean) ? result->score_mean : result->return_mean;
}

std::vector<Row> MakeRows(const Runs& runs) {
  std::vector<Row> rows;
  for (int task = 0; task < runs.grid.task_size(); ++task) {
    for (const Measure& measure : MeasuresOf(runs.grid.task(task)))
      rows.push_back(MakeRow(runs, task, measure, rows.size()));
  }
  return rows;
}

std::optional<Row> OverAllScores(const Runs& runs, const std::vector<Row>& rows) {
  std::set<int> tasks;
  int scored = 0;
  for (const Row& row : rows) {
    if (!row.score) continue;
    tasks.insert(row.task);
    ++scored;
  }
  if (scored < 2) return std::nullopt;
  Measure measure;
  measure.set_label("All scores");
  Row overall = EmptyRow(runs, -1, measure);
  overall.score = true;
  const Strata strata = RunsOfScores(runs, rows);
  const Rng rng = Rng(kBootstrapSeed).Fork(rows.size());
  for (int c = 0; c < runs.grid.contender_size(); ++c) {
    std::vector<std::vector<double>> of_tasks;
    for (const int task : tasks) {
      const auto found = strata.find({task, c});
      if (found != strata.end()) of_tasks.push_back(found->second);
    }
    if (of_tasks.size() < tasks.size()) continue;
    Sample& sample = overall.samples[c];
    for (const std::vector<double>& stratum : of_tasks)
      sample.values.insert(sample.values.end(), stratum.begin(), stratum.end());
    sample.cells[static_cast<int>(ReportedState::kDone)] = static_cast<int>(sample.values.size());
    Summarise(of_tasks, rng.Fork(c), &sample);
  }
  return overall;
}

const Published* PublishedOf(const Measure& measure, const std::string& contender) {
  for (const Published& published : measure.published()) {
    if (published.contender() == contender) return &published;
  }
  return nullptr;
}

std::string FigureText(const Row& row, double value) {
  return Fixed(value, row.score ? 3 : 1);
}

std::string MeanText(const Row& row, const Sample& sample) {
  if (sample.all() == 0) return "–";
  if (sample.values.empty()) return Unfinished(sample);
  if (sample.values.size() == 1) return absl::StrCat(FigureText(row, sample.mean), " (one seed)");
  return absl::StrCat(FigureText(row, sample.mean), " ± ", FigureText(row, sample.std));
}

std::string IqmText(const Row& row, const Sample& sample) {
  if (!std::isfinite(sample.interval.low)) return "–";
  return absl::StrCat(FigureText(row, sample.iqm), " [", FigureText(row, sample.interval.low), ", ",
                      FigureText(row, sample.interval.high), "]");
}

std::string SeedsText(const Sample& sample) {
  const std::size_t done = sample.values.size();
  if (sample.all() == 0) return "–";
  if (static_cast<int>(done) == sample.all()) return absl::StrCat(done);
  return absl::StrCat(done, " of ", sample.all(), ": ", Unfinished(sample));
}

std::string PublishedText(const Published* published) {
  if (published == nullptr) return "–";
  std::string text = absl::StrCat(published->mean());
  if (published->has_std()) absl::StrAppend(&text, " ± ", published->std());
  return text;
}

int BestOf(const Row& row, const std::vector<int>& contenders) {
  int best = -1;
  for (const int c : contenders) {
    if (!std::isfinite(row.samples[c].mean)) continue;
    if (best < 0 || row.samples[c].mean > row.samples[best].mean) best = c;
  }
  return best;
}

}  // namespace dbr::report
