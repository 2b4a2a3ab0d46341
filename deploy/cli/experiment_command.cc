#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"
#include "deploy/cli/shipped_file.h"
#include "deploy/experiment/cell.h"
#include "deploy/experiment/check.h"
#include "deploy/experiment/grid.h"
#include "deploy/experiment/run.h"
#include "deploy/experiment/schedule.h"
#include "deploy/manual/number_option.h"
#include "deploy/terminal/output.h"
#include "deploy/terminal/terminal.h"
#include "nn/precision.h"
#include "proto/config/experiment_file.h"

namespace dbr {
namespace {

constexpr int kStateCells = 24;

struct ExperimentFlags {
  std::string grid;
  GridOptions cells;
  ExperimentOptions run;
  bool dry_run = false;
};

// What would be done to each cell.
void PrintPlan(const Grid& grid) {
  std::printf("experiment %s at scale %s: %zu cells\nrun folder: %s\n", grid.name.c_str(), grid.scale.c_str(),
              grid.cells.size(), grid.run_dir.c_str());
  for (const Cell& cell : grid.cells) {
    const CellStanding standing = ReadStanding(cell);
    const int cores = CellCost(cell.config);
    std::string text = absl::StrCat("  ", PadRight(StateText(standing.state), kStateCells), cell.name());
    if (standing.state == CellState::kDone) {
      absl::StrAppend(&text, "  ", ResultText(standing.summary));
    } else if (standing.state != CellState::kBusy) {
      absl::StrAppend(&text, "  ", cores, cores == 1 ? " core" : " cores");
    }
    if (standing.state == CellState::kChanged)
      absl::StrAppend(&text, ", differs in (before -> now):\n", standing.difference);
    std::printf("%s%s", text.c_str(), text.back() == '\n' ? "" : "\n");
  }
}

// What `dbr report` reads beside the cells: the grid, and the scale that they run at.
absl::Status WriteDescription(const Experiment& experiment, const Grid& grid) {
  std::error_code error;
  std::filesystem::create_directories(grid.run_dir, error);
  if (error) return ErrnoStatus(error.value(), "cannot create", grid.run_dir);
  RETURN_IF_ERROR(WriteFileAtomically(absl::StrCat(grid.run_dir, "/", kGridFile), experiment.DebugString()));
  return WriteFileAtomically(absl::StrCat(grid.run_dir, "/", kScaleFile), absl::StrCat(grid.scale, "\n"));
}

absl::StatusOr<int> RunExperiment(const ExperimentFlags& flags) {
  ASSIGN_OR_RETURN(const std::string path, FindShippedFile(flags.grid));
  ASSIGN_OR_RETURN(const Experiment experiment, LoadExperiment(path));
  ASSIGN_OR_RETURN(Grid grid, MakeCheckedGrid(experiment, flags.cells));
  if (flags.dry_run) {
    PrintPlan(grid);
    return 0;
  }
  for (const Cell& cell : grid.cells) {
    if (const absl::Status precision = UsesBfloat16(cell.config.network()).status(); !precision.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("task '", cell.task, "', contender '", cell.contender,
                                                     "': ", std::string(precision.message())));
    }
  }
  RETURN_IF_ERROR(WriteDescription(experiment, grid));
  ExperimentOptions options = flags.run;
  ASSIGN_OR_RETURN(options.programs, ProgramsFolder());
  options.capacity.cores = static_cast<int>(std::thread::hardware_concurrency());
  Output out(STDOUT_FILENO);
  return ExperimentRun(std::move(grid), std::move(options), &out).Run();
}

void AddChoices(CLI::App* command, ExperimentFlags* flags) {
  command->add_option("GRID", flags->grid, "The grid: a text file of the message Experiment")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--only", flags->cells.only,
                   "Run only the cells that a glob matches by TASK, CONTENDER, TASK/CONTENDER or "
                   "TASK/CONTENDER/seed-N; may be repeated")
      ->type_name("GLOB")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--seeds", flags->cells.seeds, "Seeds 1 to N of each cell [as the scale says]")
      ->transform(WholeNumber(1, 1000))
      ->type_name("N");
  command
      ->add_option("--scale", flags->cells.scale, "How long the cells run: a scale of the grid [its first]")
      ->type_name("NAME");
}

void AddWays(CLI::App* command, ExperimentFlags* flags) {
  command
      ->add_option("--jobs", flags->run.capacity.jobs,
                   "Cells at once [as many as the cores carry: one core a learner, one an actor process]")
      ->transform(WholeNumber(1, 1024))
      ->type_name("N");
  command->add_option("--run-dir", flags->cells.run_dir, "Folder of the runs [runs/NAME-SCALE]")
      ->type_name("DIR");
  command->add_option("--data", flags->cells.data, "Folder of the seed buffers that the grid names")
      ->capture_default_str()
      ->type_name("DIR");
  command->add_flag("--dry-run", flags->dry_run, "Print what would be run, and run nothing");
  command->add_flag("--keep-stores", flags->run.keep_stores,
                    "Keep the replay store and the checkpoints of cells that are done");
  command->add_flag("--overwrite-changed", flags->run.overwrite_changed,
                    "Move runs that have another config to RUN_DIR/aside and start them anew, instead of "
                    "leaving them alone");
}

}  // namespace

void AddExperiment(CLI::App* app, int* exit_code) {
  auto flags = std::make_shared<ExperimentFlags>();
  CLI::App* command = app->add_subcommand(
      "experiment", "Run a grid of tasks x algorithms x seeds, or go on with one that was stopped");
  AddChoices(command, flags.get());
  AddWays(command, flags.get());
  command->footer(
      "Each cell is an ordinary run in RUN_DIR/TASK/CONTENDER/seed-N, with its config and the log of its\n"
      "launches beside it. Ctrl-C saves and stops; the same command goes on. A cell that is done is not run\n"
      "again.\n"
      "Exit status: 0 when all cells are done, 1 when one failed or was left alone, 2 for a bad grid or\n"
      "flag, 130 after Ctrl-C or SIGTERM.\n\n"
      "Examples:\n"
      "  dbr experiment deploy/experiments/paper.textproto --scale smoke --dry-run\n"
      "  dbr experiment deploy/experiments/paper.textproto --scale short --only 'hopper-*/dbr' --seeds 2");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunExperiment(*flags);
    *exit_code = result.ok() ? *result : Fail("experiment", result.status());
  });
}

}  // namespace dbr
