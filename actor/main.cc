// dbr-actor: acts and writes transitions, or with --evaluate plays evaluation episodes.
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "actor/actor.h"
#include "core/exhaustion.h"
#include "core/run_folder.h"
#include "core/shutdown.h"
#include "core/standard_streams.h"
#include "deploy/manual/man_page.h"
#include "deploy/manual/number_option.h"
#include "nn/product/blas_setup.h"
#include "proto/config/config_file.h"
#include "proto/rpc/exit_status.h"
#include "proto/rpc/service_main.h"

namespace dbr {
namespace {

struct Flags {
  std::string config;
  std::string run_dir;
  int index = 0;
  int processes = 0;
  std::string replay;
  std::string learner;
  bool evaluate = false;
  bool resume = false;
};

void Declare(CLI::App* app, Flags* flags) {
  app->add_option("--config", flags->config, "Config file")->required()->type_name("FILE");
  app->add_option("--run-dir", flags->run_dir, "Folder of the run")->required()->type_name("DIR");
  app->add_option("--index", flags->index, "Number of this actor among the actors of the run")
      ->transform(WholeNumber(0, 1023))
      ->type_name("N");
  app->add_option("--processes", flags->processes,
                  "How many actors the run has, for what they do together [as the config says, or 1]")
      ->transform(WholeNumber(0, 1024))
      ->type_name("N");
  app->add_option("--replay", flags->replay,
                  "Address of the replay server [the config's, else the socket in the run folder]")
      ->type_name("ADDRESS");
  app->add_option("--learner", flags->learner,
                  "Address of the learner [the config's, else the socket in the run folder]")
      ->type_name("ADDRESS");
  app->add_flag("--evaluate", flags->evaluate, "Be the evaluator: play evaluation episodes, insert nothing");
  app->add_flag("--resume", flags->resume,
                "With --evaluate: take over in the middle of a run, and leave alone the iterations that an "
                "earlier evaluator saw");
  AddManPagesOption(app);
  app->footer("Example: dbr-actor --config my.textproto --run-dir runs/mine --index 0");
}

int Fail(const absl::Status& status) {
  spdlog::error("{}", std::string(status.message()));
  return ExitStatusOf(status);
}

// Connects the shutdown signals to a process's Stop, runs the process to its end and returns the exit code.
template <class Process>
int RunProcess(const absl::StatusOr<std::unique_ptr<Process>>& process) {
  if (!process.ok()) return Fail(process.status());
  const ShutdownWatcher watcher([&process] { (*process)->Stop(); });
  const absl::Status status = (*process)->Run();
  return status.ok() ? 0 : Fail(status);
}

int Main(int argc, char** argv) {
  Flags flags;
  CLI::App app(
      "Acts in many environments by the learner's newest policy and writes transitions to the replay "
      "server.",
      "dbr-actor");
  Declare(&app, &flags);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kFinalExit;
  }
  const std::string name = flags.evaluate ? "evaluator" : absl::StrCat("actor-", flags.index);
  UseStderrLog(name);

  if (const absl::Status memory = CheckBlasMemory(/*threads=*/1); !memory.ok()) return Fail(memory);
  absl::StatusOr<Config> config = LoadConfig(flags.config);
  if (!config.ok()) return Fail(config.status());
  const RunFolder run{flags.run_dir};
  const absl::StatusOr<std::string> replay =
      ChooseAddress(flags.replay, config->replay().address(), run.replay_address());
  if (!replay.ok()) return Fail(replay.status());
  const absl::StatusOr<std::string> learner =
      ChooseAddress(flags.learner, config->learner().address(), run.learner_address());
  if (!learner.ok()) return Fail(learner.status());
  const ActorOptions options = {.config = *config,
                                .index = flags.index,
                                .processes = flags.processes,
                                .replay_address = *replay,
                                .learner_address = *learner,
                                .resumed = flags.resume,
                                .best_policy = run.best_policy()};
  return flags.evaluate ? RunProcess(EvaluatorProcess::Create(options)) : RunProcess(Actor::Create(options));
}

}  // namespace
}  // namespace dbr

int main(int argc, char** argv) {
  dbr::RestartWithBlasSetUp(argv);
  dbr::HoldStandardStreams();
  dbr::EndWhereResourcesAreExhausted();
  dbr::BlockShutdownSignals();
  return dbr::Main(argc, argv);
}
