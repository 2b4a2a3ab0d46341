#include "deploy/experiment/grid.h"

#include <fnmatch.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"

namespace dbr {
namespace {

const Config& OfKind(const Scale& scale, Task::Kind kind) {
  switch (kind) {
    case Task::OFFLINE:
      return scale.offline();
    case Task::ONLINE:
      return scale.online();
    case Task::FINETUNE:
      return scale.finetune();
    case Task::GAMES:
      break;
  }
  return scale.games();
}

template <class Globs>
bool AnyMatches(const Globs& globs, const std::string& text) {
  return std::any_of(globs.begin(), globs.end(),
                     [&text](const std::string& glob) { return MatchesGlob(glob, text); });
}

bool IsFor(const TaskConfig& on, const Task& task, const Scale& scale) {
  if (!on.scale().empty() && on.scale() != scale.name()) return false;
  return on.task().empty() || AnyMatches(on.task(), task.name());
}

// A cell with the first seed, and no folder yet, for each pair of a task and a contender that takes part in
// it.
std::vector<Cell> FirstCells(const Experiment& experiment, const Scale& scale, const std::string& data) {
  std::vector<Cell> cells;
  for (const Task& task : experiment.task()) {
    for (const Contender& contender : experiment.contender()) {
      if (!TakesPart(contender, task)) continue;
      cells.push_back({.task = task.name(),
                       .contender = contender.name(),
                       .kind = task.kind(),
                       .seed = 1,
                       .config = MergedConfig(experiment, task, contender, scale, data),
                       .folder = {}});
    }
  }
  return cells;
}

std::vector<Cell> AllSeeds(const std::vector<Cell>& first_cells, std::uint32_t seeds,
                           const std::string& run_dir) {
  std::vector<Cell> cells;
  for (std::uint32_t seed = 1; seed <= seeds; ++seed) {
    for (const Cell& first : first_cells) {
      Cell cell = first;
      cell.seed = seed;
      cell.config.set_seed(seed);
      cell.folder = absl::StrCat(run_dir, "/", cell.name());
      cells.push_back(std::move(cell));
    }
  }
  return cells;
}

}  // namespace

std::string Cell::name() const {
  return absl::StrCat(task, "/", contender, "/seed-", seed);
}

std::string Cell::log() const {
  return absl::StrCat(folder, ".log");
}

std::string Cell::config_file() const {
  return absl::StrCat(folder, ".textproto");
}

Grid MakeGrid(const Experiment& experiment, const Scale& scale, const GridOptions& options) {
  Grid grid{.name = experiment.name(), .scale = scale.name(), .run_dir = options.run_dir, .cells = {}};
  if (grid.run_dir.empty()) grid.run_dir = absl::StrCat("runs/", grid.name, "-", grid.scale);
  const std::uint32_t seeds = options.seeds > 0 ? options.seeds : scale.seeds();
  grid.cells = AllSeeds(FirstCells(experiment, scale, options.data), seeds, grid.run_dir);
  return grid;
}

void Choose(const std::vector<std::string>& only, std::vector<Cell>* cells) {
  if (only.empty()) return;
  std::erase_if(*cells, [&only](const Cell& cell) {
    return std::none_of(only.begin(), only.end(),
                        [&cell](const std::string& glob) { return Chooses(glob, cell); });
  });
}

Config MergedConfig(const Experiment& experiment, const Task& task, const Contender& contender,
                    const Scale& scale, const std::string& data) {
  Config config = experiment.base();
  config.MergeFrom(task.config());
  config.MergeFrom(contender.config());
  for (const TaskConfig& on : contender.on()) {
    if (IsFor(on, task, scale)) config.MergeFrom(on.config());
  }
  config.MergeFrom(OfKind(scale, task.kind()));
  if (config.algorithm().algorithm_case() == AlgorithmConfig::ALGORITHM_NOT_SET)
    config.mutable_algorithm()->mutable_dbr();
  if (!config.replay().seed_buffer().path().empty()) {
    const std::filesystem::path path = std::filesystem::path(data) / config.replay().seed_buffer().path();
    // In a working folder that has gone the path stays as it is, and is not found when it is looked for.
    std::error_code gone;
    const std::filesystem::path absolute = std::filesystem::absolute(path, gone);
    config.mutable_replay()->mutable_seed_buffer()->set_path(
        (gone ? path : absolute).lexically_normal().string());
  }
  return config;
}

const Scale* FindScale(const Experiment& experiment, const std::string& name) {
  for (const Scale& scale : experiment.scale()) {
    if (name.empty() || scale.name() == name) return &scale;
  }
  return nullptr;
}

bool TakesPart(const Contender& contender, const Task& task) {
  return AnyMatches(contender.task(), task.name());
}

bool MatchesGlob(const std::string& glob, const std::string& text) {
  return fnmatch(glob.c_str(), text.c_str(), FNM_PATHNAME) == 0;
}

bool Chooses(const std::string& glob, const Cell& cell) {
  for (const std::string& text :
       {cell.task, cell.contender, absl::StrCat(cell.task, "/", cell.contender), cell.name()}) {
    if (MatchesGlob(glob, text)) return true;
  }
  return false;
}

}  // namespace dbr
