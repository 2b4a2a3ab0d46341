// dbr-replay: keeps the transitions of a run and serves them.
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/synchronization/notification.h"
#include "core/exhaustion.h"
#include "core/run_folder.h"
#include "core/shutdown.h"
#include "core/standard_streams.h"
#include "core/status_macros.h"
#include "deploy/manual/man_page.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "proto/config/config_file.h"
#include "proto/rpc/exit_status.h"
#include "proto/rpc/service_main.h"
#include "replay/dataset/dataset_facts.h"
#include "replay/service/replay_server.h"

namespace dbr {
namespace {

absl::StatusOr<ReplayServerOptions> MakeOptions(const ServiceArguments& arguments, const Config& config) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv(TrainingEnv(config.env())));
  ReplayServerOptions options =
      OptionsFrom(config, TransitionLayout::Of(env->spec(), OptionalColumnsOf(config.algorithm())));
  options.store.env = env->spec().name;
  options.store.path = arguments.folder.replay_store();
  options.store.resume = arguments.resume;
  ASSIGN_OR_RETURN(options.server.address, ChooseAddress(arguments.address, config.replay().address(),
                                                         arguments.folder.replay_address()));
  options.server.allow_insecure |= arguments.allow_insecure;
  return options;
}

void LogSeedBuffer(const std::string& path, const SeedBufferRecord& seed_buffer) {
  spdlog::info(
      "seed buffer {}: {} transitions, {} whole episodes with a mean return of {:.1f}, loaded at {:.0f} "
      "rows/s",
      path, seed_buffer.rows, seed_buffer.episodes, seed_buffer.return_mean, seed_buffer.rows_per_second);
  if (seed_buffer.bad_rows > 0)
    spdlog::warn(
        "seed buffer {}: {} bad rows (a value is not finite, or a flag neither 0 nor 1) are left out", path,
        seed_buffer.bad_rows);
  for (const std::string& warning :
       DataWarnings({seed_buffer.rows, seed_buffer.episodes, seed_buffer.actions_outside}))
    spdlog::warn("seed buffer {}: {}", path, warning);
}

absl::Status Serve(const ServiceArguments& arguments, const Config& config) {
  ASSIGN_OR_RETURN(ReplayServerOptions options, MakeOptions(arguments, config));
  absl::Notification stop;
  std::atomic<bool> stopping = false;
  const ShutdownWatcher watcher([&] {
    stopping = true;
    if (!stop.HasBeenNotified()) stop.Notify();
  });
  options.seed_buffer.cancelled = &stopping;
  absl::StatusOr<std::unique_ptr<ReplayServer>> started = ReplayServer::Start(options);
  if (absl::IsCancelled(started.status())) {
    spdlog::info("stopped before the seed buffer was whole; --resume goes on with it");
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const std::unique_ptr<ReplayServer> server, std::move(started));
  if (arguments.resume) {
    spdlog::info("resumed {} with {} transitions; {} were incomplete and are dropped", options.store.path,
                 server->recovered(), server->torn());
  }
  if (!options.seed_buffer.path.empty()) LogSeedBuffer(options.seed_buffer.path, server->seed_buffer());
  spdlog::info("listening on {}", server->address());
  stop.WaitForNotification();
  spdlog::info("stopping");
  return server->Stop();
}

int Main(int argc, char** argv) {
  UseStderrLog("replay");
  CLI::App app("Keeps the transitions of a run and serves them.", "dbr-replay");
  ServiceArguments arguments;
  AddServiceFlags("Folder of the run, where the store lies", "Continue the store that the run folder has",
                  &arguments, &app);
  AddManPagesOption(&app);
  app.footer("Example: dbr-replay --config my.textproto --run-dir runs/mine");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kFinalExit;
  }
  const absl::StatusOr<Config> config = LoadConfig(arguments.config_path);
  if (!config.ok()) {
    spdlog::error("{}", std::string(config.status().message()));
    return ExitStatusOf(config.status());
  }
  std::error_code error;
  if (!arguments.resume) std::filesystem::create_directories(arguments.folder.root, error);
  if (const absl::Status status = Serve(arguments, *config); !status.ok()) {
    spdlog::error("{}", std::string(status.message()));
    return ExitStatusOf(status);
  }
  return 0;
}

}  // namespace
}  // namespace dbr

int main(int argc, char** argv) {
  dbr::HoldStandardStreams();
  dbr::EndWhereResourcesAreExhausted();
  dbr::BlockShutdownSignals();
  return dbr::Main(argc, argv);
}
