#include "deploy/experiment/cell.h"

#include <cmath>
#include <filesystem>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "core/run_folder.h"
#include "core/status_macros.h"
#include "deploy/launch/folder_claim.h"
#include "deploy/launch/same_run.h"
#include "deploy/launch/summary_reader.h"
#include "deploy/terminal/terminal.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

namespace fs = std::filesystem;

bool Exists(const std::string& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

// Indented lines.
std::string DifferenceFrom(const Cell& cell) {
  const absl::StatusOr<Config> before = LoadConfig(RunFolder{cell.folder}.config());
  const std::string difference =
      before.ok() ? DifferencesOfOutcome(*before, cell.config) : std::string(before.status().message());
  std::string indented;
  for (const absl::string_view line : absl::StrSplit(difference, '\n', absl::SkipEmpty()))
    absl::StrAppend(&indented, "    ", line, "\n");
  return indented;
}

CellState StateIn(const RunFolder& folder, const RunSummary& summary) {
  const RunState run = StateOf(summary);
  if (run == RunState::kDone) return CellState::kDone;
  if (!Exists(folder.replay_store())) return CellState::kNew;
  return run == RunState::kFailed ? CellState::kFailed : CellState::kInterrupted;
}

absl::Status MakeFolders(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  return error ? ErrnoStatus(error.value(), "cannot create", path.string()) : absl::OkStatus();
}

absl::Status Rename(const std::string& from, const std::string& to) {
  std::error_code error;
  fs::rename(from, to, error);
  return error ? ErrnoStatus(error.value(), absl::StrCat("cannot move to ", to), from) : absl::OkStatus();
}

}  // namespace

CellStanding ReadStanding(const Cell& cell) {
  CellStanding standing;
  const RunFolder folder{cell.folder};
  if (!Exists(folder.config())) return standing;
  standing.summary = ReadSummary(folder);
  standing.difference = DifferenceFrom(cell);
  if (IsInUse(folder)) {
    standing.state = CellState::kBusy;
  } else if (!standing.difference.empty()) {
    standing.state = CellState::kChanged;
  } else {
    standing.state = StateIn(folder, standing.summary);
  }
  return standing;
}

std::string StateText(CellState state) {
  switch (state) {
    case CellState::kNew:
      return "to start";
    case CellState::kInterrupted:
      return "to continue";
    case CellState::kFailed:
      return "failed, to continue";
    case CellState::kDone:
      return "done";
    case CellState::kChanged:
      return "of another config";
    case CellState::kBusy:
      break;
  }
  return "in use elsewhere";
}

std::string ResultText(const RunSummary& summary) {
  std::vector<std::string> scores;
  for (const EvaluationResult& result : summary.final_results) {
    if (std::isfinite(result.score_mean)) {
      scores.push_back(absl::StrCat(result.opponent, " ", Fixed(result.score_mean, 2)));
    } else {
      scores.push_back(
          absl::StrCat("return ", Fixed(result.return_mean, 1), " ± ", Fixed(result.return_std, 1)));
    }
  }
  return absl::StrJoin(scores, ", ");
}

absl::Status PrepareCell(const Cell& cell) {
  RETURN_IF_ERROR(MakeFolders(fs::path(cell.folder).parent_path()));
  return WriteFileAtomically(cell.config_file(), PrintConfig(cell.config));
}

absl::StatusOr<std::string> MoveAside(const Cell& cell, const std::string& run_dir) {
  if (!Exists(cell.folder)) return std::string();
  std::string target;
  for (int k = 1; target.empty() || Exists(target) || Exists(absl::StrCat(target, ".log")); ++k)
    target = absl::StrCat(run_dir, "/", kAsideFolder, "/", cell.name(), ".", k);
  RETURN_IF_ERROR(MakeFolders(fs::path(target).parent_path()));
  RETURN_IF_ERROR(Rename(cell.folder, target));
  if (Exists(cell.log())) RETURN_IF_ERROR(Rename(cell.log(), absl::StrCat(target, ".log")));
  return target;
}

absl::Status RemoveStores(const Cell& cell) {
  const RunFolder folder{cell.folder};
  for (const std::string& path : {folder.replay_store(), folder.checkpoints()}) {
    std::error_code error;
    fs::remove_all(path, error);
    if (error) return ErrnoStatus(error.value(), "cannot remove", path);
  }
  return absl::OkStatus();
}

}  // namespace dbr
