#include "deploy/report/tables.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "deploy/report/grid.h"
#include "deploy/terminal/terminal.h"

namespace dbr::report {
namespace {

bool AnyTakesPart(const Row& row, const std::vector<int>& contenders) {
  return std::any_of(contenders.begin(), contenders.end(),
                     [&row](int contender) { return row.samples[contender].all() > 0; });
}

bool AnyPublished(const Runs& runs, const Row& row, const std::vector<int>& contenders) {
  return std::any_of(contenders.begin(), contenders.end(), [&](int contender) {
    return PublishedOf(row.measure, runs.grid.contender(contender).name()) != nullptr;
  });
}

// A line of a group: what it is, and a text for each contender.
template <class TextOf>
std::vector<TableCell> LineOf(const std::string& label, const char* what, const std::vector<int>& contenders,
                              TextOf text_of) {
  std::vector<TableCell> line = {{label}, {what}};
  for (const int contender : contenders) line.push_back({text_of(contender)});
  return line;
}

// The group of lines of one row.
void AppendRow(const Runs& runs, const Row& row, const std::vector<int>& contenders, Table* table) {
  std::string label = row.measure.label();
  if (AnyPublished(runs, row, contenders)) {
    table->rows.push_back(LineOf(label, "published", contenders, [&](int c) {
      return PublishedText(PublishedOf(row.measure, runs.grid.contender(c).name()));
    }));
    label.clear();
  }
  if (!AnyTakesPart(row, contenders)) return;
  if (row.task >= 0) {
    std::vector<TableCell> ours =
        LineOf(label, "ours", contenders, [&](int c) { return MeanText(row, row.samples[c]); });
    const int best = BestOf(row, contenders);
    for (std::size_t i = 0; i < contenders.size(); ++i) ours[i + 2].bold = contenders[i] == best;
    table->rows.push_back(std::move(ours));
    if (best < 0) return;  // no run is done
    label.clear();
  }
  table->rows.push_back(
      LineOf(label, "IQM [95%]", contenders, [&](int c) { return IqmText(row, row.samples[c]); }));
  table->rows.push_back(LineOf("", row.task >= 0 ? "seeds" : "runs", contenders,
                               [&](int c) { return SeedsText(row.samples[c]); }));
}

Table MakeTable(const Runs& runs, const std::vector<Row>& rows, const std::vector<int>& contenders) {
  Table table;
  table.header = {"task", ""};
  for (const int contender : contenders) table.header.push_back(LabelOf(runs.grid.contender(contender)));
  for (const Row& row : rows) AppendRow(runs, row, contenders, &table);
  return table;
}

std::vector<TableCell> CellLine(const Runs& runs, const ReportedCell& cell, bool first_of_task) {
  const RunSummary& summary = cell.summary;
  std::vector<std::string> texts = {first_of_task ? runs.grid.task(cell.task).name() : "",
                                    runs.grid.contender(cell.contender).name(), absl::StrCat(cell.seed),
                                    NameOf(cell.state)};
  if (summary.ended == RunEnding::kNone) {
    texts.resize(13, "–");
  } else {
    texts.insert(
        texts.end(),
        {std::string(TextOf(summary.ended)), summary.commit.empty() ? "–" : summary.commit.substr(0, 12),
         Clock(absl::Seconds(summary.wall_s)), WithCommas(summary.updates), WithCommas(summary.transitions),
         WithCommas(summary.games), cell.digest.empty() ? "–" : cell.digest,
         summary.matrix_products.empty() ? "–" : summary.matrix_products,
         summary.final_policy.empty() ? "–" : summary.final_policy});
  }
  std::vector<TableCell> line;
  for (std::string& text : texts) line.push_back({std::move(text)});
  return line;
}

void AddFailures(const Runs& runs, Document* document) {
  List failures;
  for (const ReportedCell& cell : runs.cells) {
    if (cell.state != ReportedState::kFailed) continue;
    failures.items.push_back(absl::StrCat(runs.grid.task(cell.task).name(), ", ",
                                          runs.grid.contender(cell.contender).name(), ", seed ", cell.seed,
                                          ": ", cell.failure.empty() ? "it does not say why" : cell.failure));
  }
  if (failures.items.empty()) return;
  document->Add(Paragraph{"These failed:"});
  document->Add(std::move(failures));
}

}  // namespace

void AddResults(const Runs& runs, const std::vector<Row>& rows, Document* document) {
  document->Add(Heading{2, "Results"});
  document->Add(
      Paragraph{"Published: mean ± standard deviation as printed. Ours: the mean over seeds of each run's "
                "final evaluation ± the "
                "standard deviation over seeds, the best of a row in bold; one seed has no ±. IQM: the "
                "interquartile mean over "
                "seeds (a quarter of them, rounded down, cut off at either end, so that below four seeds it "
                "is the mean), with the "
                "95% interval of 2,000 bootstrap resamples of the seeds, stratified by task where several "
                "are taken together. "
                "Games are scored 1 for a win and 0.5 for a draw; robots by an episode's return. Returns of "
                "different robots "
                "have no common scale and are not averaged."});
  std::vector<int> contenders = Columns(runs.grid);
  contenders.erase(std::remove_if(contenders.begin(), contenders.end(),
                                  [&](int contender) {
                                    return std::none_of(rows.begin(), rows.end(), [&](const Row& row) {
                                      return AnyTakesPart(row, {contender}) ||
                                             AnyPublished(runs, row, {contender});
                                    });
                                  }),
                   contenders.end());
  Table table = MakeTable(runs, rows, contenders);
  if (const std::optional<Row> overall = OverAllScores(runs, rows))
    AppendRow(runs, *overall, contenders, &table);
  document->Add(std::move(table));
}

void AddAblationTable(const Runs& runs, const std::vector<Row>& rows, const std::vector<int>& family,
                      Document* document) {
  const std::vector<int> ablations(family.begin() + 1, family.end());
  std::vector<Row> shared;
  for (const Row& row : rows) {
    if (AnyTakesPart(row, ablations)) shared.push_back(row);
  }
  if (!shared.empty()) document->Add(MakeTable(runs, shared, family));
}

void AddCells(const Runs& runs, Document* document) {
  document->Add(Heading{2, "Cells"});
  document->Add(Paragraph{
      "Config is a checksum of a run's settings but its seed and what cannot change its results (threads, "
      "addresses, restarts, checkpoints, the folder of its data): runs with the same one differ in nothing "
      "else. "
      "Steps and games are those of the actors; time is wall-clock time with the final evaluation."});
  AddFailures(runs, document);
  Table table;
  table.fold = absl::StrCat("all ", runs.cells.size(), " cells");
  table.header = {"task",    "contender", "seed",  "state",  "ended",           "commit", "time (h:m:s)",
                  "updates", "steps",     "games", "config", "matrix products", "policy"};
  int task = -1;
  for (const ReportedCell& cell : runs.cells) {
    table.rows.push_back(CellLine(runs, cell, cell.task != task));
    task = cell.task;
  }
  document->Add(std::move(table));
}

void AddSettings(const Runs& runs, Document* document) {
  document->Add(Heading{2, "Settings"});
  document->Add(
      Paragraph{"What each task's and contender's config sets, beside the schema's defaults and the seed."});
  std::map<std::pair<int, int>, std::map<std::string, std::vector<const ReportedCell*>>> by_digest;
  for (const ReportedCell& cell : runs.cells) {
    if (!cell.digest.empty()) by_digest[{cell.task, cell.contender}][cell.digest].push_back(&cell);
  }
  for (const auto& [place, configs] : by_digest) {
    for (const auto& [digest, cells] : configs) {
      const std::string seeds = absl::StrJoin(
          cells, ", ", [](std::string* out, const ReportedCell* cell) { absl::StrAppend(out, cell->seed); });
      document->Add(
          Listing{absl::StrCat(runs.grid.task(place.first).name(), " · ",
                               runs.grid.contender(place.second).name(), " · config ", digest,
                               configs.size() > 1 ? absl::StrCat(" (seeds ", seeds, " alone)") : ""),
                  cells[0]->settings});
    }
  }
  if (by_digest.empty()) document->Add(Paragraph{"No cell has a config yet."});
}

}  // namespace dbr::report
