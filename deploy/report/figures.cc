#include "deploy/report/figures.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "deploy/report/board_figure.h"
#include "deploy/report/grid.h"
#include "deploy/report/tables.h"

namespace dbr::report {
namespace {

constexpr char kUpdatesLabel[] = "gradient updates";
constexpr char kStepsLabel[] = "environment steps";

const char* ValueLabel(const Row& row) {
  return row.score ? "score (win 1, draw 0.5)" : "return of an episode";
}

// A file's name from a task's: letters, digits, '.', '_' and '-'.
std::string FileName(absl::string_view text) {
  std::string name(text);
  for (char& c : name) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_') c = '-';
  }
  return name;
}

// Tells the rows of one task apart.
std::string FileName(const Runs& runs, const Row& row) {
  const std::string task = runs.grid.task(row.task).name();
  return FileName(row.measure.opponent().empty() ? task : absl::StrCat(task, "-", row.measure.opponent()));
}

// Tasks with a seed buffer are named ENVIRONMENT-QUALITY.
std::string GroupOf(const Task& task) {
  if (task.kind() == Task::ONLINE) return "online";
  if (task.kind() == Task::GAMES) return "games";
  const std::size_t dash = task.name().rfind('-');
  return absl::StrCat(
      task.kind() == Task::FINETUNE ? "fine-tuned" : "offline",
      dash == std::string::npos ? "" : absl::StrCat(", ", task.name().substr(dash + 1), " data"));
}

std::optional<Estimate> EstimateOf(const Published* published) {
  if (published == nullptr) return std::nullopt;
  Estimate estimate = {.value = published->mean()};
  if (published->has_std()) {
    estimate.low = published->mean() - published->std();
    estimate.high = published->mean() + published->std();
  }
  return estimate;
}

std::optional<Estimate> MeanAndStd(const Sample& sample) {
  if (sample.values.empty()) return std::nullopt;
  return Estimate{sample.mean, sample.mean - sample.std, sample.mean + sample.std};
}

std::optional<Estimate> IqmAndInterval(const Sample& sample) {
  if (sample.values.empty()) return std::nullopt;
  return Estimate{sample.iqm, sample.interval.low, sample.interval.high};
}

BarPanel BesidePublished(const Runs& runs, const Row& row) {
  BarPanel panel = {row.measure.label(), ValueLabel(row), {}};
  for (const int c : Columns(runs.grid)) {
    const Contender& contender = runs.grid.contender(c);
    Bar bar = {LabelOf(contender), EstimateOf(PublishedOf(row.measure, contender.name())),
               MeanAndStd(row.samples[c])};
    if (row.samples[c].all() > 0 || bar.published.has_value()) panel.bars.push_back(std::move(bar));
  }
  return panel;
}

// The mean return of the data that a task's runs started from, as the first of them has it.
std::optional<double> ReturnOfData(const Runs& runs, int task) {
  for (const ReportedCell& cell : runs.cells) {
    if (cell.task == task && cell.summary.seed_buffer.rows > 0 &&
        std::isfinite(cell.summary.seed_buffer.return_mean))
      return cell.summary.seed_buffer.return_mean;
  }
  return std::nullopt;
}

CurvePlot CurvesOf(const Runs& runs, const Row& row, const std::vector<int>& contenders) {
  const bool online = runs.grid.task(row.task).kind() == Task::ONLINE;
  CurvePlot plot;
  plot.title = row.measure.label();
  plot.x_label = online ? kStepsLabel : kUpdatesLabel;
  plot.y_label = ValueLabel(row);
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    plot.lines.push_back({LabelOf(runs.grid.contender(contenders[i])), static_cast<int>(i),
                          MakeCurve(runs, row.task, contenders[i], row.measure.opponent(),
                                    online ? Axis::kSteps : Axis::kUpdates)});
  }
  plot.reference = ReturnOfData(runs, row.task);
  plot.reference_label = "mean of the data";
  return plot;
}

void AddNothingDrawn(const std::vector<std::string>& labels, Document* document) {
  if (labels.empty()) return;
  document->Add(Paragraph{
      absl::StrCat("Nothing to draw yet, for no run has finished: ", absl::StrJoin(labels, "; "), ".")});
}

constexpr char kCurveCaption[] =
    "Evaluations during training: the mean over seeds and, where there are two or more, the band from the "
    "least seed to the "
    "greatest.";

void AddFamily(const Runs& runs, const std::vector<Row>& rows, const std::vector<int>& family,
               Document* document, Drawings* drawings) {
  const Contender& base = runs.grid.contender(family[0]);
  document->Add(Heading{2, absl::StrCat("Ablations of ", LabelOf(base))});
  AddAblationTable(runs, rows, family, document);
  BarPlot bars;
  bars.our_label = "IQM over seeds, 95% interval";
  std::vector<std::string> nothing;
  for (const Row& row : rows) {
    if (std::none_of(family.begin() + 1, family.end(), [&row](int c) { return row.samples[c].all() > 0; }))
      continue;
    BarPanel panel = {row.measure.label(), ValueLabel(row), {}};
    for (const int c : family)
      panel.bars.push_back({LabelOf(runs.grid.contender(c)), std::nullopt, IqmAndInterval(row.samples[c])});
    bars.panels.push_back(std::move(panel));
  }
  drawings->Add(
      absl::StrCat("ablations-", FileName(base.name())), absl::StrCat("Ablations of ", LabelOf(base)),
      "Final evaluations: the interquartile mean over seeds with its 95% interval (one seed has none).",
      std::move(bars), document);
  for (const Row& row : rows) {
    if (std::none_of(family.begin() + 1, family.end(), [&row](int c) { return row.samples[c].all() > 0; }))
      continue;
    const std::string name =
        absl::StrCat("ablation-curves-", FileName(base.name()), "-", FileName(runs, row));
    if (!drawings->Add(name, kCurveCaption, CurvesOf(runs, row, family), document))
      nothing.push_back(row.measure.label());
  }
  AddNothingDrawn(nothing, document);
}

}  // namespace

void AddBars(const Runs& runs, const std::vector<Row>& rows, Document* document, Drawings* drawings) {
  document->Add(Heading{2, "Final evaluations"});
  std::vector<std::pair<std::string, BarPlot>> groups;
  for (const Row& row : rows) {
    const std::string name = GroupOf(runs.grid.task(row.task));
    auto group =
        std::find_if(groups.begin(), groups.end(), [&name](const auto& one) { return one.first == name; });
    if (group == groups.end()) {
      group = groups.emplace(groups.end(), name, BarPlot());
      group->second.published_label = "published, ± std";
      group->second.our_label = "ours, ± std over seeds";
    }
    group->second.panels.push_back(BesidePublished(runs, row));
  }
  for (auto& [name, plot] : groups) {
    drawings->Add(
        absl::StrCat("bars-", FileName(name)), absl::StrCat("Final evaluations: ", name),
        absl::StrCat(
            "Final evaluations, ", name,
            ": the published mean ± standard deviation, and the mean of ours ± the standard deviation "
            "over seeds (one seed has none). Where a bar is missing nothing was published, or no run "
            "has finished."),
        std::move(plot), document);
  }
}

void AddCurves(const Runs& runs, const std::vector<Row>& rows, Document* document, Drawings* drawings) {
  document->Add(Heading{2, "Learning curves"});
  std::vector<std::string> nothing;
  for (const Row& row : rows) {
    if (!drawings->Add(absl::StrCat("curves-", FileName(runs, row)), kCurveCaption,
                       CurvesOf(runs, row, Columns(runs.grid)), document))
      nothing.push_back(row.measure.label());
  }
  AddNothingDrawn(nothing, document);
}

void AddAblations(const Runs& runs, const std::vector<Row>& rows, Document* document, Drawings* drawings) {
  for (const int base : Columns(runs.grid)) {
    const std::vector<int> family = WithAblations(runs.grid, base);
    if (family.size() > 1) AddFamily(runs, rows, family, document, drawings);
  }
}

absl::Status AddBoard(const Runs& runs, std::vector<std::string>* notes, Document* document,
                      Drawings* drawings) {
  if (std::none_of(runs.grid.task().begin(), runs.grid.task().end(),
                   [](const Task& task) { return task.kind() == Task::GAMES; })) {
    return absl::OkStatus();
  }
  document->Add(Heading{2, "A Connect-4 board"});
  const std::vector<BoardAnswer> answers = BoardAnswers(runs, notes);
  if (answers.empty()) {
    document->Add(Paragraph{
        "Bars beside the board need a finished run with its policy/latest.safetensors; there is none."});
  }
  return drawings->Add("board", "A Connect-4 board where Red must block, and what the policies make of it",
                       "Red to play; column 7 must be blocked, or Yellow wins there. Bars: the probability "
                       "of each column under the "
                       "policy and under the behaviour policies that it is held to; blue is the right move.",
                       BoardFigure(answers), document);
}

}  // namespace dbr::report
