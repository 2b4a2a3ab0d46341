// The cells of a grid as their folders show them: what ran, how far it came, and what it measured.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "deploy/launch/run_summary.h"
#include "proto/experiment.pb.h"

namespace dbr::report {

enum class ReportedState {
  kNotRun,   // there is no folder
  kRunning,  // it has begun and has not ended
  kStopped,  // it was interrupted
  kFailed,   // it ended with an error, or its summary is damaged
  kDone,     // it came to its end and to its final evaluation
};

// "not run", "running", "stopped", "failed", "done".
const char* NameOf(ReportedState state);

struct ReportedCell {
  int task = 0;       // index in the grid
  int contender = 0;  // index in the grid
  std::uint64_t seed = 0;
  std::string folder;  // RUN_DIR/TASK/CONTENDER/seed-N; empty where it was not run
  ReportedState state = ReportedState::kNotRun;
  std::string failure;   // why a failed one failed
  RunSummary summary;    // where one could be read
  std::string settings;  // Settings::differences of its config
  std::string digest;    // Settings::digest of its config; empty where the config could not be read
};

struct Runs {
  Experiment grid;
  std::string scale;                // empty: not known
  std::vector<ReportedCell> cells;  // in the grid's order: by task, by contender, by seed
  std::vector<std::string> notes;   // what a reader must know: damaged files, folders that no grid knows
};

// Reads the experiments' folders (RUN_DIR/TASK/CONTENDER/seed-N/{summary.json, config.textproto}). The grid
// is the file at `grid_path`, or where that is empty what RUN_DIR/experiment.textproto of each folder says,
// earlier folders going before later ones. Each cell is expected with the seeds of the scale in
// RUN_DIR/scale.txt (with one where the scale is not known), and with all others that have a folder. Where
// two folders have the same cell, the one that is done counts, else the first. InvalidArgument for a folder
// that holds no experiment; see LoadExperiment for others. What is wrong within a cell is that cell's failure
// and a note.
absl::StatusOr<Runs> LoadRuns(absl::Span<const std::string> folders, const std::string& grid_path);

}  // namespace dbr::report
