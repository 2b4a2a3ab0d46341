// What the files of a cell say, and what is done to them. A cell is an ordinary run that `dbr launch` made in
// the cell's folder.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "deploy/experiment/grid.h"
#include "deploy/launch/run_summary.h"

namespace dbr {

// In a grid's run folder: where runs of another config are moved to.
inline constexpr absl::string_view kAsideFolder = "aside";

enum class CellState {
  kNew,          // no run that could go on
  kInterrupted,  // goes on with --resume
  kFailed,       // so does this one: its last launch failed
  kDone,         // ended at its limit, and has its final results
  kChanged,      // a run of another config
  kBusy,         // another launch is at work on it
};

struct CellStanding {
  CellState state = CellState::kNew;
  RunSummary summary;      // what the run came to; zeros where there is none
  std::string difference;  // kChanged: an indented line for each field
};

// Reads the cell's folder, each of its files once, and compares its config with the cell's
// (DifferencesOfOutcome).
CellStanding ReadStanding(const Cell& cell);

// "to start", "to continue", "failed, to continue", "done", "of another config", "in use elsewhere".
std::string StateText(CellState state);

// The final results of a run in few words: "return 812.3 ± 20.1" with the standard deviation over episodes,
// or a score for each opponent, "random 0.99, mcts:100 0.62"; empty where there are none.
std::string ResultText(const RunSummary& summary);

// Makes the folder in which the cell's folder, log and config file lie, and writes the config file.
absl::Status PrepareCell(const Cell& cell);

// Moves what stands in the place of the cell's folder, with its log, to
// RUN_DIR/aside/TASK/CONTENDER/seed-N.K, where K is the first number from 1 on that is free. Returns that
// path; empty where there was nothing. Nothing is deleted.
absl::StatusOr<std::string> MoveAside(const Cell& cell, const std::string& run_dir);

// Removes the store and the checkpoints, which only continuing the run would need. Policies, results, metrics
// and logs stay.
absl::Status RemoveStores(const Cell& cell);

}  // namespace dbr
