#include "deploy/report/report.h"

#include <array>
#include <cstddef>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "deploy/report/cells.h"
#include "deploy/report/document.h"
#include "deploy/report/figures.h"
#include "deploy/report/scores.h"
#include "deploy/report/tables.h"

namespace dbr::report {
namespace {

absl::Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!error) return absl::OkStatus();
  return ErrnoStatus(error.value(), "--out: cannot make the folder", path);
}

std::string CountsOf(const Runs& runs) {
  std::array<int, 5> counts = {};
  for (const ReportedCell& cell : runs.cells) ++counts[static_cast<int>(cell.state)];
  std::string text =
      absl::StrCat(counts[static_cast<int>(ReportedState::kDone)], " of ", runs.cells.size(), " cells done");
  for (const ReportedState state :
       {ReportedState::kRunning, ReportedState::kStopped, ReportedState::kFailed, ReportedState::kNotRun}) {
    const int count = counts[static_cast<int>(state)];
    if (count > 0) absl::StrAppend(&text, ", ", count, " ", NameOf(state));
  }
  return text;
}

void AddOpening(const Runs& runs, const std::string& counts, Document* document) {
  document->title = absl::StrCat(runs.grid.name(), ": published and ours");
  document->Add(Paragraph{absl::StrCat(
      counts, runs.scale.empty() ? std::string(".") : absl::StrCat(", at scale ", runs.scale, "."),
      " A task, a contender and a seed make a cell. Only cells that are done give figures; the others are "
      "named by what "
      "they are.")});
}

// Takes the place of a picture that was not drawn.
Block WithoutPicture(const Picture& picture) {
  return Paragraph{absl::StrCat(picture.title, ": not drawn.")};
}

// The text of each picture's file; a picture that has none leaves a word in its place.
std::vector<std::string> ReadPictures(const std::string& folder, Document* document) {
  std::vector<std::string> svgs;
  for (Block& block : document->blocks) {
    const Picture* picture = std::get_if<Picture>(&block);
    if (picture == nullptr) continue;
    absl::StatusOr<std::string> svg = ReadFile(absl::StrCat(folder, "/", picture->file));
    if (svg.ok() && !svg->empty()) {
      svgs.push_back(*std::move(svg));
    } else {
      block = WithoutPicture(Picture(*picture));
    }
  }
  return svgs;
}

}  // namespace

absl::StatusOr<ReportOutcome> WriteReport(const ReportOptions& options) {
  ASSIGN_OR_RETURN(Runs runs, LoadRuns(options.runs, options.grid));
  RETURN_IF_ERROR(MakeFolder(absl::StrCat(options.out, "/plots")));
  ReportOutcome outcome;
  outcome.counts = CountsOf(runs);
  outcome.notes = std::move(runs.notes);
  const std::vector<Row> rows = MakeRows(runs);
  Document document;
  Drawings drawings(options.out);
  AddOpening(runs, outcome.counts, &document);
  AddResults(runs, rows, &document);
  AddBars(runs, rows, &document, &drawings);
  AddCurves(runs, rows, &document, &drawings);
  AddAblations(runs, rows, &document, &drawings);
  RETURN_IF_ERROR(AddBoard(runs, &outcome.notes, &document, &drawings));
  AddCells(runs, &document);
  AddSettings(runs, &document);
  outcome.plots = drawings.Draw();
  if (absl::IsCancelled(outcome.plots)) return outcome.plots;
  std::vector<std::string> notes = outcome.notes;
  if (!outcome.plots.ok()) notes.push_back(absl::StrCat("no plots: ", outcome.plots.message()));
  if (!notes.empty()) {
    document.Add(Heading{2, "Notes"});
    document.Add(List{std::move(notes)});
  }
  const std::vector<std::string> svgs = ReadPictures(options.out, &document);
  RETURN_IF_ERROR(WriteFileAtomically(absl::StrCat(options.out, "/report.md"), Markdown(document)));
  RETURN_IF_ERROR(WriteFileAtomically(absl::StrCat(options.out, "/report.html"), Html(document, svgs)));
  return outcome;
}

}  // namespace dbr::report
