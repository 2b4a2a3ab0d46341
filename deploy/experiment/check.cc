#include "deploy/experiment/check.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "actor/evaluation_loop.h"
#include "core/space.h"
#include "core/status_macros.h"
#include "deploy/experiment/cell.h"
#include "deploy/launch/run_limits.h"
#include "deploy/launch/run_plan.h"
#include "proto/config/config_check.h"
#include "proto/config/config_combinations.h"
#include "proto/config/config_fields.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

bool CanNameAFolder(const std::string& name) {
  const auto fits = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '_' || c == '-' || c == '+';
  };
  return !name.empty() && name[0] != '.' && name[0] != '-' && std::all_of(name.begin(), name.end(), fits);
}

template <class Named>
std::vector<std::string> NamesOf(const Named& all) {
  std::vector<std::string> names;
  for (const auto& one : all) names.push_back(one.name());
  return names;
}

// `what` the names are of: "task".
void CheckNames(const char* what, const std::vector<std::string>& names, std::vector<std::string>* errors) {
  if (names.empty()) errors->push_back(absl::StrCat(what, ": expected at least one, found none"));
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (!seen.insert(name).second)
      errors->push_back(absl::StrCat(what, " '", name, "': expected each name once, found it again"));
    if (!CanNameAFolder(name)) {
      errors->push_back(absl::StrCat(what, " '", name, "': expected letters, digits, '.', '_', '+' and '-', ",
                                     "since it names a folder, beginning with a letter or digit"));
    }
  }
}

// Checks a glob of a contender's `field`, which must match one of `tasks`.
void CheckGlob(const std::string& contender, const char* field, const std::string& glob,
               const std::vector<std::string>& tasks, std::vector<std::string>* errors) {
  const auto matches = [&glob](const std::string& task) { return MatchesGlob(glob, task); };
  if (std::any_of(tasks.begin(), tasks.end(), matches)) return;
  errors->push_back(absl::StrCat("contender '", contender, "': ", field,
                                 ": expected a glob that matches a task, found '", glob, "'; ",
                                 Suggest(glob, tasks)));
}

void CheckContender(const Experiment& experiment, const Contender& contender,
                    std::vector<std::string>* errors) {
  const std::vector<std::string> tasks = NamesOf(experiment.task());
  if (contender.task().empty()) {
    errors->push_back(absl::StrCat("contender '", contender.name(), "': task: expected the tasks that it ",
                                   "takes part in, as globs, found none; \"*\" is all"));
  }
  for (const std::string& glob : contender.task()) CheckGlob(contender.name(), "task", glob, tasks, errors);
  std::vector<std::string> own;
  for (const Task& task : experiment.task()) {
    if (TakesPart(contender, task)) own.push_back(task.name());
  }
  for (const TaskConfig& on : contender.on()) {
    for (const std::string& glob : on.task())
      CheckGlob(contender.name(), "on.task", glob, own.empty() ? tasks : own, errors);
    if (!on.scale().empty() && FindScale(experiment, on.scale()) == nullptr) {
      errors->push_back(absl::StrCat("contender '", contender.name(), "': on.scale: expected a scale of the ",
                                     "grid, found '", on.scale(), "'; ",
                                     Suggest(on.scale(), NamesOf(experiment.scale()))));
    }
  }
  std::vector<std::string> others = NamesOf(experiment.contender());
  std::erase(others, contender.name());
  if (!contender.has_ablation_of() || contender.ablation_of().empty()) return;
  if (std::find(others.begin(), others.end(), contender.ablation_of()) != others.end()) return;
  errors->push_back(absl::StrCat("contender '", contender.name(), "': ablation_of: expected another ",
                                 "contender's name, found '", contender.ablation_of(), "'; ",
                                 Suggest(contender.ablation_of(), others)));
}

void CheckPublished(const Task& task, const std::vector<std::string>& contenders,
                    std::vector<std::string>* errors) {
  for (const Measure& measure : task.measure()) {
    for (const Published& published : measure.published()) {
      if (std::find(contenders.begin(), contenders.end(), published.contender()) != contenders.end())
        continue;
      errors->push_back(absl::StrCat("task '", task.name(), "': measure.published.contender: expected a ",
                                     "contender's name, found '", published.contender(), "'; ",
                                     Suggest(published.contender(), contenders)));
    }
  }
}

// The environments of cells, each made once.
class EnvSpecs {
 public:
  const absl::StatusOr<EnvSpec>& Of(const Config& config) {
    const std::string key = config.env().SerializeAsString();
    const auto found = specs_.find(key);
    return found != specs_.end() ? found->second : specs_.emplace(key, EnvSpecOf(config)).first->second;
  }

 private:
  std::map<std::string, absl::StatusOr<EnvSpec>> specs_;
};

// A row of the report that the final evaluation would leave empty; "" where there is none.
std::string WrongMeasure(const Task& task, const Config& config, const EnvSpec& env) {
  const auto& named = config.evaluation().final_opponents();
  const std::vector<std::string> met = OpponentsToEvaluate(env.name, {named.begin(), named.end()});
  for (const Measure& measure : task.measure()) {
    const std::string& opponent = measure.opponent();
    if (opponent.empty() || std::find(met.begin(), met.end(), opponent) != met.end()) continue;
    return absl::StrCat("measure.opponent: expected one of the final evaluation's (",
                        absl::StrJoin(met, ", "), "), found '", opponent, "'");
  }
  return "";
}

// Whether a task with a seed buffer is of its kind; "" where it is, and for tasks of other kinds.
std::string WrongKind(Task::Kind kind, const Config& config) {
  if (kind != Task::OFFLINE && kind != Task::FINETUNE) return "";
  const bool offline = kind == Task::OFFLINE;
  if (config.replay().seed_buffer().path().empty()) {
    return absl::StrCat("replay.seed_buffer.path: expected the seed buffer of ",
                        offline ? "an offline" : "a fine-tuning", " task, found none");
  }
  if (TrainsOfflineAlone(config) == offline) return "";
  if (!offline) {
    return absl::StrCat("expected a fine-tuning task to have actors, with learner.max_updates of 0 or above ",
                        "learner.offline_updates, found ", config.learner().max_updates(), " and ",
                        config.learner().offline_updates());
  }
  return absl::StrCat("expected an offline task to have learner.max_updates of 1 to ",
                      "learner.offline_updates, so that no actor acts, found ",
                      config.learner().max_updates(), " and ", config.learner().offline_updates());
}

// False also where that cannot be found out.
bool Exists(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

// What makes the file of a task's seed buffer.
std::string RecordCommand(const Task& task, const std::string& path) {
  if (task.record_command().empty()) return "; the grid has no record_command for it";
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  return absl::StrCat("; make it with:\n    ",
                      Exists(folder) ? "" : absl::StrCat("mkdir -p ", folder.string(), " && "),
                      absl::StripAsciiWhitespace(task.record_command()), " --out ", path);
}

const Task& TaskOf(const Experiment& experiment, const Cell& cell) {
  return *std::find_if(experiment.task().begin(), experiment.task().end(),
                       [&cell](const Task& task) { return task.name() == cell.task; });
}

// What is wrong with the grid itself.
std::vector<std::string> FindGridErrors(const Experiment& experiment) {
  std::vector<std::string> errors;
  CheckNames("experiment", {experiment.name()}, &errors);
  CheckNames("task", NamesOf(experiment.task()), &errors);
  CheckNames("contender", NamesOf(experiment.contender()), &errors);
  CheckNames("scale", NamesOf(experiment.scale()), &errors);
  for (const Task& task : experiment.task()) {
    if (task.name() == kAsideFolder)
      errors.push_back(absl::StrCat("task '", task.name(), "': expected another name: runs of another ",
                                    "config are moved to a folder of this one"));
  }
  for (const Contender& contender : experiment.contender()) CheckContender(experiment, contender, &errors);
  const std::vector<std::string> contenders = NamesOf(experiment.contender());
  for (const Task& task : experiment.task()) CheckPublished(task, contenders, &errors);
  return errors;
}

// What is wrong with pairs of task and contender, by the first seed's cell of each.
void FindPairErrors(const Experiment& experiment, const std::vector<Cell>& cells,
                    std::vector<std::string>* errors) {
  EnvSpecs specs;
  for (const Cell& cell : cells) {
    if (cell.seed != 1) continue;
    const auto note = [&](absl::string_view what) {
      errors->push_back(absl::StrCat("task '", cell.task, "', contender '", cell.contender, "': ", what));
    };
    std::vector<std::string> contradictions;
    FindContradictions(cell.config, &contradictions);
    for (const std::string& contradiction : contradictions) note(contradiction);
    const absl::StatusOr<EnvSpec>& env = specs.Of(cell.config);
    const absl::Status fits = env.ok() ? CheckFits(cell.config, *env) : env.status();
    if (!fits.ok()) note(fits.message());
    const std::string measure =
        fits.ok() ? WrongMeasure(TaskOf(experiment, cell), cell.config, *env) : std::string();
    if (!measure.empty()) note(measure);
    const std::string kind = WrongKind(cell.kind, cell.config);
    if (!kind.empty()) {
      note(kind);
    } else if (!RunLimits(cell.config).any()) {
      note(
          "expected an end, found none: set learner.max_updates, launch.max_steps, launch.max_episodes or "
          "launch.max_seconds");
    }
  }
}

// Which globs choose none of the cells.
void FindUnansweredGlobs(const std::vector<std::string>& only, const Experiment& experiment,
                         const std::vector<Cell>& cells, std::vector<std::string>* errors) {
  std::vector<std::string> known = NamesOf(experiment.task());
  const std::vector<std::string> contenders = NamesOf(experiment.contender());
  known.insert(known.end(), contenders.begin(), contenders.end());
  for (const std::string& glob : only) {
    const auto chosen = [&glob](const Cell& cell) { return Chooses(glob, cell); };
    if (std::any_of(cells.begin(), cells.end(), chosen)) continue;
    errors->push_back(absl::StrCat("--only: expected a glob of TASK, CONTENDER, TASK/CONTENDER or ",
                                   "TASK/CONTENDER/seed-N that a cell answers to, found '", glob, "'; ",
                                   Suggest(glob, known)));
  }
}

// What is wrong with the chosen cells.
void FindCellErrors(const Experiment& experiment, const std::vector<Cell>& cells,
                    std::vector<std::string>* errors) {
  std::set<std::string> missing;
  for (const Cell& cell : cells) {
    const std::string& path = cell.config.replay().seed_buffer().path();
    if (path.empty() || Exists(path)) continue;
    if (ReadStanding(cell).state != CellState::kNew || !missing.insert(path).second) continue;
    errors->push_back(absl::StrCat("task '", cell.task, "': expected its seed buffer, found no file '", path,
                                   "'", RecordCommand(TaskOf(experiment, cell), path)));
  }
}

}  // namespace

absl::StatusOr<Grid> MakeCheckedGrid(const Experiment& experiment, const GridOptions& options) {
  std::vector<std::string> errors = FindGridErrors(experiment);
  const Scale* scale = FindScale(experiment, options.scale);
  if (scale == nullptr && experiment.scale_size() > 0) {
    errors.push_back(absl::StrCat("--scale: expected a scale of the grid, found '", options.scale, "'; ",
                                  Suggest(options.scale, NamesOf(experiment.scale()))));
    scale = FindScale(experiment, "");  // what is wrong with the cells is told beside it
  }
  const std::string source = absl::StrCat("experiment '", experiment.name(), "'");
  if (scale == nullptr) return AllErrors(errors, source);
  Grid grid = MakeGrid(experiment, *scale, options);
  FindPairErrors(experiment, grid.cells, &errors);
  FindUnansweredGlobs(options.only, experiment, grid.cells, &errors);
  Choose(options.only, &grid.cells);
  FindCellErrors(experiment, grid.cells, &errors);
  RETURN_IF_ERROR(AllErrors(errors, source));
  return grid;
}

}  // namespace dbr
