// dbr-learner: trains an algorithm from a replay server and serves its policy.
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/exhaustion.h"
#include "core/run_folder.h"
#include "core/shutdown.h"
#include "core/standard_streams.h"
#include "core/status_macros.h"
#include "core/stop_flag.h"
#include "deploy/manual/man_page.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "learner/algorithms/registry.h"
#include "learner/runtime/checkpoints.h"
#include "learner/runtime/finetune.h"
#include "learner/runtime/policy_service.h"
#include "learner/runtime/rollout_reporter.h"
#include "learner/runtime/trainer.h"
#include "nn/precision.h"
#include "nn/product/blas_setup.h"
#include "nn/product/product_library.h"
#include "proto/config/config_file.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/exit_status.h"
#include "proto/rpc/server.h"
#include "proto/rpc/service_main.h"
#include "replay/client/await_stats.h"

namespace dbr {
namespace {

constexpr absl::Duration kMetricsFlush = absl::Seconds(2);
constexpr absl::Duration kRolloutPeriod = absl::Seconds(5);

struct Arguments : ServiceArguments {
  std::string replay_address;
};

absl::StatusOr<AlgorithmSpec> MakeSpec(const Config& config) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv(TrainingEnv(config.env())));
  ASSIGN_OR_RETURN(const bool bfloat16, UsesBfloat16(config.network()));
  spdlog::info("matrix products: {}", KernelsName(bfloat16));
  return AlgorithmSpec{.env = env->spec().name,
                       .observation_size = env->spec().observation_size,
                       .actions = env->spec().actions,
                       .symmetry = env->spec().symmetry,
                       .hidden_sizes = HiddenSizes(config),
                       .normalize_observations = config.network().normalize_observations(),
                       .critic_layer_norm = config.network().critic_layer_norm(),
                       .bfloat16 = bfloat16,
                       .config = config.algorithm(),
                       .seed = config.seed()};
}

// Loads the newest whole checkpoint; one that is missing altogether is a start from nothing.
absl::Status Resume(const RunFolder& folder, const LearnerConfig& config, Trainer* trainer) {
  const absl::StatusOr<Checkpoints::Loaded> loaded =
      Checkpoints(folder.checkpoints(), static_cast<int>(config.keep_checkpoints())).LoadNewest();
  if (absl::IsNotFound(loaded.status())) {
    spdlog::warn("{}: training starts from nothing", std::string(loaded.status().message()));
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(loaded.status());
  for (const std::string& refused : loaded->refused)
    spdlog::warn("refused a damaged checkpoint: {}", refused);
  if (const absl::Status status = trainer->Load(loaded->file); !status.ok()) {
    return absl::Status(status.code(), absl::StrCat("cannot resume from ", loaded->path, ": ",
                                                    std::string(status.message())));
  }
  spdlog::info("resumed from {} at update {}", loaded->path, trainer->updates());
  return absl::OkStatus();
}

// Labels that the replay has may be newer than what `trainer` goes on from, and it refuses older ones: no
// training before it has told of them. It also tells what the seed buffer's episodes returned. Blocks until
// then, or until a signal has stopped the trainer.
absl::Status AskReplay(ReplayClient* replay, Trainer* trainer, Finetune* finetune) {
  StopFlag stopping;
  const ShutdownWatcher watcher([&] {
    stopping.Set();
    trainer->Stop();
  });
  const absl::StatusOr<StatsReply> stats =
      AwaitStats(replay, "to hear of its newest labels and its seed buffer", stopping);
  if (stopping.IsSet()) return absl::OkStatus();
  RETURN_IF_ERROR(stats.status());
  trainer->StartVersionsAfter(stats->newest_critic_version());
  if (stats->seed_buffer_episodes() > 0) finetune->set_seed_buffer_return(stats->seed_buffer_return_mean());
  return absl::OkStatus();
}

void WriteEvaluation(const EvaluationReport& report, MetricsSink* metrics) {
  const std::string against = report.opponent().empty() ? "" : absl::StrCat("/", report.opponent());
  Scalars scalars = {{absl::StrCat(tags::kEvaluationReturn, against), report.return_mean()}};
  if (std::isfinite(report.score_mean())) {
    scalars.emplace_back(absl::StrCat(tags::kEvaluationScore, against), report.score_mean());
  }
  const absl::Status status =
      metrics->Write(static_cast<std::int64_t>(report.updates()), absl::Now(), scalars);
  if (!status.ok()) spdlog::error("metrics: {}", std::string(status.message()));
}

std::unique_ptr<Prefetcher> MakePrefetcher(const Config& config, const AlgorithmSpec& spec,
                                           const BatchNeeds& needs, ReplayClient* draws) {
  const TransitionLayout layout = TransitionLayout::Of(
      {.name = spec.env, .observation_size = spec.observation_size, .actions = spec.actions},
      OptionalColumnsOf(config.algorithm()));
  return std::make_unique<Prefetcher>(
      draws, PrefetcherOptions{.counts = {needs.uniform, needs.plus, needs.minus},
                               .layout = layout,
                               .depth = static_cast<int>(config.learner().prefetch())});
}

absl::Status Serve(const Arguments& arguments, const Config& config) {
  RETURN_IF_ERROR(CheckBlasMemory(/*threads=*/2));  // the second network's, where the config asks for it
  const LearnerConfig& learner = config.learner();
  ASSIGN_OR_RETURN(const AlgorithmSpec spec, MakeSpec(config));
  ASSIGN_OR_RETURN(std::unique_ptr<Algorithm> algorithm, MakeAlgorithm(spec));
  ASSIGN_OR_RETURN(const std::unique_ptr<MetricsSink> metrics,
                   MetricsSink::Open(arguments.folder, kMetricsFlush, absl::Now()));
  Finetune finetune(config);
  PolicyService service([&](const EvaluationReport& report) {
    WriteEvaluation(report, metrics.get());
    finetune.Observe(report);
  });
  Saver saver(arguments.folder, static_cast<int>(learner.keep_checkpoints()));
  ReplayClient draws(arguments.replay_address), labels(arguments.replay_address),
      stats(arguments.replay_address);
  const BatchNeeds needs = algorithm->needs();
  TrainerParts parts{
      .algorithm = std::move(algorithm),
      .matrix_products = KernelsName(spec.bfloat16),
      .policy_service = &service,
      .metrics = metrics.get(),
      .saver = &saver,
      .prefetcher = MakePrefetcher(config, spec, needs, &draws),
      .relabeller = std::make_unique<Relabeller>(&labels),
      .finetune = &finetune,
  };
  Trainer trainer(learner, std::move(parts));
  if (arguments.resume) RETURN_IF_ERROR(Resume(arguments.folder, learner, &trainer));
  RETURN_IF_ERROR(metrics->StartSession(static_cast<std::int64_t>(trainer.updates()), absl::Now()));
  RETURN_IF_ERROR(AskReplay(&stats, &trainer, &finetune));
  ASSIGN_OR_RETURN(
      const RunningServer running,
      StartServer({arguments.address, arguments.allow_insecure || learner.allow_insecure()}, {&service}));
  spdlog::info("listening on {}", running.address);
  absl::Status status;
  {
    const RolloutReporter reporter(&stats, metrics.get(), kRolloutPeriod);
    const ShutdownWatcher watcher([&] { trainer.Stop(); });
    status = trainer.Run();
  }
  service.Close();
  running.server->Shutdown(DeadlineAfter(absl::Seconds(1)));
  status.Update(metrics->Flush());
  return status;
}

// Fills in the addresses that no flag gives.
absl::Status ChooseAddresses(const Config& config, Arguments* arguments) {
  const RunFolder& folder = arguments->folder;
  ASSIGN_OR_RETURN(
      arguments->replay_address,
      ChooseAddress(arguments->replay_address, config.replay().address(), folder.replay_address()));
  ASSIGN_OR_RETURN(arguments->address,
                   ChooseAddress(arguments->address, config.learner().address(), folder.learner_address()));
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  UseStderrLog("learner");
  CLI::App app("Trains an algorithm from a replay server and serves its policy.", "dbr-learner");
  Arguments arguments;
  AddServiceFlags("Folder of the run: checkpoints, policy, metrics",
                  "Continue from the newest checkpoint of the run folder", &arguments, &app);
  app.add_option("--replay", arguments.replay_address,
                 "Address of the replay server [the config's, else the socket in the run folder]")
      ->type_name("ADDRESS");
  AddManPagesOption(&app);
  app.footer("Example: dbr-learner --config my.textproto --run-dir runs/mine");
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
  absl::Status status = ChooseAddresses(*config, &arguments);
  if (status.ok()) {
    std::error_code error;
    std::filesystem::create_directories(arguments.folder.root, error);
    status = Serve(arguments, *config);
  }
  if (!status.ok()) {
    spdlog::error("{}", std::string(status.message()));
    return ExitStatusOf(status);
  }
  return 0;
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
