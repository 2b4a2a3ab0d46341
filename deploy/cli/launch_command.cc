#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"
#include "deploy/cli/common_options.h"
#include "deploy/cli/shipped_file.h"
#include "deploy/launch/launch.h"
#include "deploy/launch/run_plan.h"
#include "deploy/manual/number_option.h"
#include "deploy/terminal/output.h"
#include "nn/product/blas_setup.h"

namespace dbr {
namespace {

struct LaunchFlags {
  LaunchOptions options;
  std::optional<std::uint64_t> seed;
};

absl::StatusOr<int> RunLaunch(const LaunchFlags& flags) {
  // For the final evaluation, before hours of training.
  RETURN_IF_ERROR(CheckBlasMemory(static_cast<int>(std::thread::hardware_concurrency())));
  LaunchOptions options = flags.options;
  if (flags.seed.has_value()) options.overrides.push_back(absl::StrCat("seed=", *flags.seed));
  if (!options.config.empty()) {
    ASSIGN_OR_RETURN(options.config, FindShippedFile(options.config));
  }
  ASSIGN_OR_RETURN(const std::string programs, ProgramsFolder());
  ASSIGN_OR_RETURN(RunPlan plan, PrepareRun(options, absl::Now()));
  Output out(STDOUT_FILENO);
  ASSIGN_OR_RETURN(const std::unique_ptr<Launch> launch, Launch::Create(std::move(plan), programs, &out));
  return launch->Run();
}

}  // namespace

void AddLaunch(CLI::App* app, int* exit_code) {
  auto flags = std::make_shared<LaunchFlags>();
  CLI::App* command = app->add_subcommand(
      "launch", "Train: start replay, learner, actors and evaluator, and watch over them");
  command
      ->add_option("CONFIG", flags->options.config, "Config file [with --resume: the one of the run folder]")
      ->type_name("FILE");
  command->add_option("--set", flags->options.overrides, "Override a field of the config; may be repeated")
      ->type_name("PATH=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--seed", flags->seed, "Random seed: short for --set seed=N")
      ->transform(WholeNumber())
      ->type_name("N");
  command->add_option("--run-dir", flags->options.run_dir, "Folder of the run [runs/ENV-ALGORITHM-DATE-TIME]")
      ->type_name("DIR");
  command->add_flag("--resume", flags->options.resume, "Continue the run in --run-dir");
  command
      ->add_option(
          "--seed-buffer", flags->options.seed_buffer,
          "HDF5 file of offline data, or folder of a Minari dataset, that the replay server begins with: "
          "replay.seed_buffer.path")
      ->type_name("FILE");
  command
      ->add_option("--seed-layout", flags->options.seed_layout,
                   "Layout of the seed buffer [as the file itself says; never guessed]")
      ->type_name(kLayoutNames);
  command->add_flag(
      "--skip-bad-rows", flags->options.skip_bad_rows,
      "Leave out rows of the seed buffer with a value that is not finite, or a flag neither 0 nor 1");
  command->footer(
      "The run ends when it reaches launch.max_seconds, launch.max_episodes, launch.max_steps,\n"
      "launch.stop_at_return or learner.max_updates of the config, or on Ctrl-C; everything is saved first.\n"
      "A second Ctrl-C kills the process that is being waited for.\n"
      "Exit status: 0 after a limit, 1 for a failure, 2 for what another start would meet again (a bad\n"
      "config or flag, an address in use, a damaged file), 130 after Ctrl-C or SIGTERM.\n\n"
      "Examples:\n"
      "  dbr launch deploy/configs/connect4.textproto\n"
      "  dbr launch deploy/configs/connect4.textproto --set launch.max_seconds=60 --set "
      "algorithm.dbr.epsilon=0.1 --seed 2\n"
      "  dbr launch deploy/configs/hopper_finetune.textproto --seed-buffer hopper-medium.hdf5\n"
      "  dbr launch --resume --run-dir runs/first");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunLaunch(*flags);
    *exit_code = result.ok() ? *result : Fail("launch", result.status());
  });
}

}  // namespace dbr
