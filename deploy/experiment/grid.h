// The cells of a grid of runs: which there are, and the config of each.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "proto/experiment.pb.h"

namespace dbr {

// In a grid's run folder, for reports: the grid as text, and the name of the scale that its cells run at.
inline constexpr absl::string_view kGridFile = "experiment.textproto";
inline constexpr absl::string_view kScaleFile = "scale.txt";

struct GridOptions {
  std::string scale = {};              // empty: the grid's first
  std::uint32_t seeds = 0;             // 0: as many as the scale says
  std::vector<std::string> only = {};  // globs; empty: all cells
  std::string data = "runs/data";      // the folder of the seed buffers
  std::string run_dir = {};            // empty: runs/NAME-SCALE
};

// One run of a contender on a task.
struct Cell {
  std::string task;
  std::string contender;
  Task::Kind kind = Task::OFFLINE;
  std::uint32_t seed = 1;
  Config config;       // as the run has it, merged; the path of its seed buffer is absolute
  std::string folder;  // RUN_DIR/TASK/CONTENDER/seed-N

  std::string name() const;         // TASK/CONTENDER/seed-N
  std::string log() const;          // what its launches said: beside the folder
  std::string config_file() const;  // what it is launched with: beside the folder
};

struct Grid {
  std::string name;
  std::string scale;
  std::string run_dir;
  // All of the first seed, then all of the second, ...; tasks and contenders in the file's order.
  std::vector<Cell> cells;
};

// The grid at one of its scales with every cell, whatever options.scale and options.only say. Nothing is
// checked: MakeCheckedGrid (deploy/experiment/check.h) does that.
Grid MakeGrid(const Experiment& experiment, const Scale& scale, const GridOptions& options);

// Leaves the cells that one of the globs chooses; all of them where there is no glob.
void Choose(const std::vector<std::string>& only, std::vector<Cell>* cells);

// The config of a cell but for its seed (the order stands in proto/experiment.proto), with the path of its
// seed buffer within `data`, and absolute.
Config MergedConfig(const Experiment& experiment, const Task& task, const Contender& contender,
                    const Scale& scale, const std::string& data);

// The scale of that name, or the first where it is empty; null where there is none.
const Scale* FindScale(const Experiment& experiment, const std::string& name);

bool TakesPart(const Contender& contender, const Task& task);

// Shell globs (* ? [a-z]) in which * does not go over a slash.
bool MatchesGlob(const std::string& glob, const std::string& text);

// Whether --only GLOB chooses a cell: by TASK, CONTENDER, TASK/CONTENDER or TASK/CONTENDER/seed-N.
bool Chooses(const std::string& glob, const Cell& cell);

}  // namespace dbr
