#include "deploy/report/cells.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "deploy/experiment/grid.h"
#include "deploy/launch/summary_reader.h"
#include "deploy/report/grid.h"
#include "deploy/report/settings.h"
#include "proto/config/experiment_file.h"

namespace dbr::report {
namespace {

namespace fs = std::filesystem;

using CellKey = std::tuple<int, int, std::uint64_t>;  // task, contender, seed
constexpr absl::string_view kSeedPrefix = "seed-";

// Names of the folders in `folder`, sorted.
std::vector<std::string> FoldersIn(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_directory(ignored)) names.push_back(entry->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool HoldsSeeds(const std::string& folder) {
  const std::vector<std::string> names = FoldersIn(folder);
  return std::any_of(names.begin(), names.end(),
                     [](const std::string& name) { return absl::StartsWith(name, kSeedPrefix); });
}

template <class Named>
int IndexOf(const google::protobuf::RepeatedPtrField<Named>& list, const std::string& name) {
  const auto found =
      std::find_if(list.begin(), list.end(), [&name](const Named& one) { return one.name() == name; });
  return found == list.end() ? -1 : static_cast<int>(found - list.begin());
}

// One that was not run.
ReportedCell CellAt(int task, int contender, std::uint64_t seed) {
  ReportedCell cell;
  cell.task = task;
  cell.contender = contender;
  cell.seed = seed;
  return cell;
}

ReportedState ReportedStateOf(RunState run) {
  switch (run) {
    case RunState::kNotBegun:
    case RunState::kRunning:
      return ReportedState::kRunning;
    case RunState::kInterrupted:
      return ReportedState::kStopped;
    case RunState::kFailed:
      return ReportedState::kFailed;
    case RunState::kDone:
      break;
  }
  return ReportedState::kDone;
}

void ReadSummaryOf(ReportedCell* cell, std::vector<std::string>* notes) {
  absl::StatusOr<RunSummary> summary = LoadSummary(RunFolder{cell->folder});
  if (summary.ok()) {
    cell->summary = *std::move(summary);
    cell->state = ReportedStateOf(StateOf(cell->summary));
    cell->failure = cell->summary.failure;
    return;
  }
  cell->state = absl::IsNotFound(summary.status()) ? ReportedState::kRunning : ReportedState::kFailed;
  if (cell->state == ReportedState::kRunning) return;  // it has just begun
  cell->failure = std::string(summary.status().message());
  notes->push_back(cell->failure);
}

void ReadSettingsOf(ReportedCell* cell, std::vector<std::string>* notes) {
  const absl::StatusOr<Settings> settings = LoadSettings(RunFolder{cell->folder}.config());
  if (settings.ok()) {
    cell->settings = settings->differences;
    cell->digest = settings->digest;
  } else if (cell->state != ReportedState::kRunning) {
    notes->push_back(std::string(settings.status().message()));
  }
}

// Gathers cells from folders; a cell that is done takes the place of one that is not.
class Gatherer {
 public:
  explicit Gatherer(Runs* runs) : runs_(runs) {}

  void Visit(const std::string& run_dir) {
    for (const std::string& name : FoldersIn(run_dir)) {
      const int task = IndexOf(runs_->grid.task(), name);
      const std::string folder = absl::StrCat(run_dir, "/", name);
      for (const std::string& contender : FoldersIn(folder))
        VisitSeeds(absl::StrCat(folder, "/", contender), task, IndexOf(runs_->grid.contender(), contender));
    }
  }

  // Adds what the grid asks for and no folder had, and hands all over in order.
  void Finish() {
    const int seeds = std::max(1, SeedsAt(runs_->grid, runs_->scale));
    for (int t = 0; t < runs_->grid.task_size(); ++t) {
      for (int c = 0; c < runs_->grid.contender_size(); ++c) {
        if (!dbr::TakesPart(runs_->grid.contender(c), runs_->grid.task(t))) continue;
        for (int seed = 1; seed <= seeds; ++seed) {
          const std::uint64_t number = seed;
          cells_.try_emplace(CellKey(t, c, number), CellAt(t, c, number));
        }
      }
    }
    for (auto& [key, cell] : cells_) runs_->cells.push_back(std::move(cell));
    NoteMixedConfigs();
  }

 private:
  // Finished seeds of one column of a row whose settings are not the same, of which figures are made
  // together.
  void NoteMixedConfigs() {
    std::map<std::pair<int, int>, std::set<std::string>> digests;
    for (const ReportedCell& cell : runs_->cells) {
      if (cell.state == ReportedState::kDone) digests[{cell.task, cell.contender}].insert(cell.digest);
    }
    for (const auto& [pair, different] : digests) {
      if (different.size() < 2) continue;
      runs_->notes.push_back(absl::StrCat(
          runs_->grid.task(pair.first).name(), "/", runs_->grid.contender(pair.second).name(), ": seeds of ",
          different.size(), " configs are averaged; the cells' settings below say in what they differ"));
    }
  }

  // Negative indices: the grid does not know it. Folders of other things (logs, a report) lie there too.
  void VisitSeeds(const std::string& folder, int task, int contender) {
    if (task < 0 || contender < 0) {
      if (!HoldsSeeds(folder)) return;
      runs_->notes.push_back(absl::StrCat(folder, ": left out, for the grid has no such ",
                                          task < 0 ? "task" : "contender",
                                          " (--grid FILE names another grid)"));
      return;
    }
    for (const std::string& name : FoldersIn(folder)) {
      std::uint64_t seed = 0;
      if (!absl::StartsWith(name, kSeedPrefix) || !absl::SimpleAtoi(name.substr(kSeedPrefix.size()), &seed))
        continue;
      ReportedCell cell = CellAt(task, contender, seed);
      cell.folder = absl::StrCat(folder, "/", name);
      Take(std::move(cell));
    }
  }

  void Take(ReportedCell cell) {
    ReadSummaryOf(&cell, &runs_->notes);
    ReadSettingsOf(&cell, &runs_->notes);
    const CellKey key(cell.task, cell.contender, cell.seed);
    const auto found = cells_.find(key);
    if (found == cells_.end()) {
      cells_.emplace(key, std::move(cell));
      return;
    }
    if (found->second.state != ReportedState::kDone && cell.state == ReportedState::kDone)
      std::swap(found->second, cell);
    runs_->notes.push_back(
        absl::StrCat(cell.folder, ": left out, for ", found->second.folder, " holds the same cell"));
  }

  Runs* runs_;
  std::map<CellKey, ReportedCell> cells_;
};

absl::Status ReadGridOf(const std::string& run_dir, bool has_grid, Runs* runs) {
  std::error_code error;
  if (!fs::is_directory(run_dir, error)) {
    return absl::InvalidArgumentError(absl::StrCat("RUNS: expected folders that dbr experiment made, found '",
                                                   run_dir, "', which is no folder"));
  }
  const std::string path = absl::StrCat(run_dir, "/", kGridFile);
  if (!has_grid && !fs::exists(path, error)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "RUNS: expected folders that dbr experiment made, found '", run_dir,
        "' without experiment.textproto: name the experiment's folder (not a cell's), or the grid "
        "with --grid FILE"));
  }
  if (!has_grid) {
    ASSIGN_OR_RETURN(const Experiment grid, LoadExperiment(path));
    if (runs->grid.name().empty()) runs->grid.set_name(grid.name());
    AddMissing(grid, &runs->grid);
  }
  const absl::StatusOr<std::string> scale = ReadFile(absl::StrCat(run_dir, "/", kScaleFile));
  if (!scale.ok()) return absl::OkStatus();
  const std::string name(absl::StripAsciiWhitespace(*scale));
  if (runs->scale.empty()) runs->scale = name;
  if (runs->scale != name)
    runs->notes.push_back(
        absl::StrCat(run_dir, ": of scale ", name, ", reported together with runs of scale ", runs->scale));
  return absl::OkStatus();
}

}  // namespace

const char* NameOf(ReportedState state) {
  switch (state) {
    case ReportedState::kNotRun:
      return "not run";
    case ReportedState::kRunning:
      return "running";
    case ReportedState::kStopped:
      return "stopped";
    case ReportedState::kFailed:
      return "failed";
    case ReportedState::kDone:
      return "done";
  }
  return "";
}

absl::StatusOr<Runs> LoadRuns(absl::Span<const std::string> folders, const std::string& grid_path) {
  Runs runs;
  if (!grid_path.empty()) {
    ASSIGN_OR_RETURN(runs.grid, LoadExperiment(grid_path));
  }
  for (const std::string& folder : folders) RETURN_IF_ERROR(ReadGridOf(folder, !grid_path.empty(), &runs));
  Gatherer gatherer(&runs);
  for (const std::string& folder : folders) gatherer.Visit(folder);
  gatherer.Finish();
  return runs;
}

}  // namespace dbr::report
