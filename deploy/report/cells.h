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
  std::string folder;  // RUN_DIR/TASK/CONTENDER/seed-N; empty for one that was not run
  ReportedState state = ReportedState::kNotRun;
  std::string failure;   // of a failed one
  RunSummary summary;    // where one could be read
  std::string settings;  // its config's fields that are not at their defaults, but for the seed, one a line
  std::string
      digest;  // CRC-32C of the effective config but for its seed, 8 hexadecimal digits; empty: unread
};

struct Runs {
  Experiment grid;
  std::string scale;                // empty: not known
  std::vector<ReportedCell> cells;  // in the grid's order: by task, by contender, by seed
  std::vector<std::string> notes;   // what a reader must know: damaged files, folders that no grid knows
};

// Reads the experiments' folders (RUN_DIR/TASK/CONTENDER/seed-N/{summary.json, config.textproto}). The grid
// is the file at `grid_path`, or where that is empty what RUN_DIR/experiment.textproto of each folder say,
// earlier folders going before later ones; seeds are those of the scale in RUN_DIR/scale.txt (one
// where it is not known) and all that have a folder. Of a cell in two folders the one that is done counts,
// else the first. InvalidArgument for a folder that holds no experiment, and see LoadExperiment; what is
// wrong within a cell is that cell's failure and a note.
absl::StatusOr<Runs> LoadRuns(absl::Span<const std::string> folders, const std::string& grid_path);

}  // namespace dbr::report
