#include "deploy/experiment/grid.h"

#include <fnmatch.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "deploy/experiment/check.h"
#include "proto/config/config_check.h"
#include "proto/config/config_fields.h"

namespace dbr {
namespace {

const Config& OfKind(const Scale& scale, Task::Kind kind) {
  switch (kind) {
    case Task::OFFLINE:
      return scale.offline();
    case Task::ONLINE:
      return scale.online();
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

// A place for each pair of a task and a contender that takes part in it, with the first seed.
std::vector<Cell> FirstCells(const Experiment& experiment, const Scale& scale, const GridOptions& options) {
  std::vector<Cell> cells;
  for (const Task& task : experiment.task()) {
    for (const Contender& contender : experiment.contender()) {
      if (!TakesPart(contender, task)) continue;
      cells.push_back({.task = task.name(),
                       .contender = contender.name(),
                       .kind = task.kind(),
                       .seed = 1,
                       .config = MergedConfig(experiment, task, contender, scale, options.data),
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

std::vector<std::string> TasksAndContenders(const Experiment& experiment) {
  std::vector<std::string> names;
  for (const Task& task : experiment.task()) names.push_back(task.name());
  for (const Contender& contender : experiment.contender()) names.push_back(contender.name());
  return names;
}

// Leaves the chosen ones, and names the globs that choose none.
void Choose(const std::vector<std::string>& only, const Experiment& experiment, std::vector<Cell>* cells,
            std::vector<std::string>* errors) {
  if (only.empty()) return;
  for (const std::string& glob : only) {
    const auto chosen = [&glob](const Cell& cell) { return Chooses(glob, cell); };
    if (std::any_of(cells->begin(), cells->end(), chosen)) continue;
    errors->push_back(absl::StrCat("--only: expected a glob of TASK, CONTENDER, TASK/CONTENDER or ",
                                   "TASK/CONTENDER/seed-N that a cell answers to, found '", glob, "'; ",
                                   Suggest(glob, TasksAndContenders(experiment))));
  }
  std::erase_if(*cells, [&only](const Cell& cell) {
    return std::none_of(only.begin(), only.end(),
                        [&cell](const std::string& glob) { return Chooses(glob, cell); });
  });
}

std::string UnknownScale(const Experiment& experiment, const std::string& name) {
  std::vector<std::string> known;
  for (const Scale& scale : experiment.scale()) known.push_back(scale.name());
  return absl::StrCat("--scale: expected a scale of the grid, found '", name, "'; ", Suggest(name, known));
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

absl::StatusOr<Grid> MakeGrid(const Experiment& experiment, const GridOptions& options) {
  std::vector<std::string> errors = FindGridErrors(experiment);
  const Scale* named = FindScale(experiment, options.scale);
  if (named == nullptr && experiment.scale_size() > 0)
    errors.push_back(UnknownScale(experiment, options.scale));
  // What is wrong with the cells is told beside an unknown scale.
  const Scale* scale = named != nullptr ? named : FindScale(experiment, "");
  const std::string source = absl::StrCat("experiment '", experiment.name(), "'");
  if (scale == nullptr) return AllErrors(errors, source);
  Grid grid{.name = experiment.name(), .scale = scale->name(), .run_dir = options.run_dir, .cells = {}};
  if (grid.run_dir.empty()) grid.run_dir = absl::StrCat("runs/", grid.name, "-", grid.scale);
  const std::uint32_t seeds = options.seeds > 0 ? options.seeds : scale->seeds();
  const std::vector<Cell> first_cells = FirstCells(experiment, *scale, options);
  FindPairErrors(experiment, first_cells, &errors);
  grid.cells = AllSeeds(first_cells, seeds, grid.run_dir);
  Choose(options.only, experiment, &grid.cells, &errors);
  FindCellErrors(experiment, grid.cells, &errors);
  RETURN_IF_ERROR(AllErrors(errors, source));
  return grid;
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
    config.mutable_replay()->mutable_seed_buffer()->set_path(
        std::filesystem::absolute(path).lexically_normal().string());
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
