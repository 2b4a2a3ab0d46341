#include "deploy/launch/run_plan.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "actor/evaluator.h"
#include "actor/exploration.h"
#include "core/file_io.h"
#include "core/shutdown.h"
#include "core/status_macros.h"
#include "deploy/launch/same_run.h"
#include "deploy/launch/summary_reader.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "learner/algorithm.h"
#include "learner/algorithms/mirrored.h"
#include "learner/algorithms/registry.h"
#include "nn/precision.h"
#include "proto/config/config_file.h"
#include "proto/rpc/address.h"
#include "replay/service/replay_server.h"
#include "replay/service/seed_buffer_import.h"

namespace dbr {
namespace {

// OK where the address of a section of the config, if it names one, is one that the launcher can hand to
// others before the server listens. `field`: the section's.
template <class Section>
absl::Status CheckAddressToTell(const Section& section, const char* field) {
  if (section.address().empty()) return absl::OkStatus();
  const auto refuse = [field](absl::string_view why) {
    return absl::InvalidArgumentError(absl::StrCat(field, ".address: ", why));
  };
  const absl::Status good = CheckServerAddress(section.address(), section.allow_insecure());
  if (!good.ok()) return refuse(good.message());
  if (ParseClientAddress(section.address()).ok()) return absl::OkStatus();
  return refuse(absl::StrCat("expected an address that the other processes can be told, found '",
                             section.address(), "'. Name a port, or leave it out for a unix socket."));
}

std::string DefaultRunDir(const Config& config, absl::Time now) {
  return absl::StrCat("runs/", config.env().name(), "-", AlgorithmName(config), "-",
                      absl::FormatTime("%Y%m%d-%H%M%S", now, absl::LocalTimeZone()));
}

absl::StatusOr<std::unique_ptr<FolderClaim>> Claim(const LaunchOptions& options, const Config& config,
                                                   absl::Time now) {
  if (options.resume) return FolderClaim::OfRun(options.run_dir);
  return options.run_dir.empty() ? FolderClaim::NewOfName(DefaultRunDir(config, now))
                                 : FolderClaim::New(options.run_dir);
}

absl::StatusOr<Config> LoadNamed(const LaunchOptions& options) {
  if (!options.config.empty()) return LoadConfig(options.config, options.overrides);
  if (options.resume && !options.run_dir.empty()) {
    return LoadConfig(RunFolder{options.run_dir}.config(), options.overrides);
  }
  return absl::InvalidArgumentError(
      "which run? Give a config file (for example deploy/configs/connect4.textproto), or --resume with "
      "--run-dir.");
}

// The config with what the flags say of the seed buffer, whose path is made absolute.
absl::StatusOr<Config> LoadForLaunch(const LaunchOptions& options) {
  ASSIGN_OR_RETURN(Config config, LoadNamed(options));
  if (options.seed_buffer.empty() && config.replay().seed_buffer().path().empty()) {
    if (options.seed_layout.empty() && !options.skip_bad_rows) return config;
    return absl::InvalidArgumentError(
        "--seed-layout and --skip-bad-rows: of which seed buffer? Name it with --seed-buffer.");
  }
  SeedBufferConfig* seed_buffer = config.mutable_replay()->mutable_seed_buffer();
  if (!options.seed_buffer.empty()) seed_buffer->set_path(options.seed_buffer);
  if (!options.seed_layout.empty()) seed_buffer->set_layout(options.seed_layout);
  if (options.skip_bad_rows) seed_buffer->set_skip_bad_rows(true);
  std::error_code error;
  std::filesystem::path path = std::filesystem::absolute(seed_buffer->path(), error);
  if (error) return ErrnoStatus(error.value(), "cannot find the working folder for", seed_buffer->path());
  path = path.lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // a folder named with a slash behind it
  seed_buffer->set_path(path.string());
  return config;
}

absl::Status CheckShareHasSeedBuffer(const SeedBufferConfig& seed_buffer) {
  if (seed_buffer.share() == 0 && seed_buffer.final_share() == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("replay.seed_buffer.share: expected a seed buffer with it, found ", seed_buffer.share(),
                   " to ", seed_buffer.final_share(), " of none. Name one with --seed-buffer FILE."));
}

// Before a folder is made for a run that could not begin.
absl::Status CheckSeedBuffer(const Config& config, const EnvSpec& env) {
  if (config.replay().seed_buffer().path().empty()) {
    RETURN_IF_ERROR(CheckShareHasSeedBuffer(config.replay().seed_buffer()));
    if (config.learner().offline_updates() == 0) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        "learner.offline_updates: ", config.learner().offline_updates(),
        " updates are to be made on a seed buffer, and none is named. Give one with --seed-buffer FILE; "
        "this records one:\n  dbr dataset record --env ",
        env.name, " --quality medium --steps 1000000 --out ", env.name, "-medium.hdf5"));
  }
  // Counting the transitions of a large file takes its time, in which Ctrl-C must work.
  std::atomic<bool> stopped = false;
  SeedBufferOptions options = SeedBufferOptionsFrom(config);
  options.cancelled = &stopped;
  absl::Status fits;
  {
    const ShutdownWatcher watcher([&stopped] { stopped = true; });
    fits = CheckSeedBufferFits(options, TransitionLayout::Of(env, OptionalColumnsOf(config.algorithm())),
                               config.replay().capacity());
  }
  return fits.ok() && stopped ? absl::CancelledError("stopped by a signal") : fits;
}

// Before hours of training, at whose end alone some of them are met.
absl::Status CheckOpponents(const std::string& env, const char* field,
                            const google::protobuf::RepeatedPtrField<std::string>& opponents) {
  const absl::Status known =
      MakeEnv({.name = env, .opponents = {opponents.begin(), opponents.end()}}).status();
  return known.ok() ? known : absl::Status(known.code(), absl::StrCat(field, ": ", known.message()));
}

// SUPPORT looks at beta+ and beta- of each action, which DBR over discrete actions alone has.
absl::Status CheckMode(const Config& config, const EnvSpec& env, const char* field, ActingMode mode) {
  if (mode != SUPPORT) return absl::OkStatus();
  if (env.actions.kind == ActionKind::kDiscrete && AlgorithmName(config) == "dbr") return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      field, ": expected SAMPLE, MODE or GREEDY_Q, for SUPPORT is for dbr over discrete actions ",
      "alone; found SUPPORT with ", AlgorithmName(config), " on ", env.name));
}

absl::Status CheckEpisodes(const char* field, std::uint32_t episodes) {
  if (episodes <= kMaxEpisodes) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(field, ": expected 1 to ", kMaxEpisodes, ", found ", episodes));
}

absl::Status CheckRunFolder(const RunFolder& folder) {
  std::error_code error;
  if (std::filesystem::exists(folder.config(), error)) return absl::OkStatus();
  if (error) return ErrnoStatus(error.value(), "--resume: cannot look at", folder.config());
  return absl::NotFoundError(absl::StrCat("--resume: '", folder.root,
                                          "' is no run folder: it has no config.textproto. ",
                                          "Name the folder that an earlier launch printed."));
}

absl::Status CheckResumable(const RunFolder& folder, const Config& config) {
  ASSIGN_OR_RETURN(const Config before, LoadConfig(folder.config()));
  if (const absl::Status read = LoadSummary(folder).status(); !read.ok() && !absl::IsNotFound(read)) {
    return absl::FailedPreconditionError(absl::StrCat("--resume: ", read.message()));
  }
  const absl::Status same = CheckSameRun(before, config);
  if (same.ok()) return same;
  return absl::InvalidArgumentError(
      absl::StrCat("--resume: '", folder.root, "' holds another run: ", same.message()));
}

ProcessSpec MakeProcess(const RunPlan& plan, const std::string& programs, const std::string& name,
                        const char* program, const std::vector<std::string>& arguments, int rank) {
  ProcessSpec process;
  process.name = name;
  process.log = plan.folder.log(name);
  process.command = {absl::StrCat(programs, "/", program), "--config", plan.claim->config_path(), "--run-dir",
                     plan.folder.root};
  process.command.insert(process.command.end(), arguments.begin(), arguments.end());
  process.stop_rank = rank;
  return process;
}

ProcessSpec MakeActor(const RunPlan& plan, const std::string& programs, const std::string& name, int index) {
  return MakeProcess(plan, programs, name, "dbr-actor",
                     {"--index", absl::StrCat(index), "--processes", absl::StrCat(plan.actors), "--replay",
                      plan.replay_address, "--learner", plan.learner_address},
                     kStopActors);
}

}  // namespace

absl::StatusOr<RunPlan> PrepareRun(const LaunchOptions& options, absl::Time now) {
  RunPlan plan;
  if (options.resume && options.run_dir.empty()) {
    return absl::InvalidArgumentError("--resume: which run? Name its folder with --run-dir.");
  }
  if (options.resume) RETURN_IF_ERROR(CheckRunFolder(RunFolder{options.run_dir}));
  ASSIGN_OR_RETURN(plan.config, LoadForLaunch(options));
  ASSIGN_OR_RETURN(plan.env, EnvSpecOf(plan.config));
  RETURN_IF_ERROR(CheckFits(plan.config, plan.env));
  RETURN_IF_ERROR(UsesBfloat16(plan.config.network()).status());
  const ReplayConfig& replay = plan.config.replay();
  const LearnerConfig& learner = plan.config.learner();
  RETURN_IF_ERROR(CheckAddressToTell(replay, "replay"));
  RETURN_IF_ERROR(CheckAddressToTell(learner, "learner"));
  if (!replay.address().empty() && replay.address() == learner.address()) {
    return absl::InvalidArgumentError(
        absl::StrCat("replay.address and learner.address: expected two addresses, found '", replay.address(),
                     "' for both"));
  }
  if (!options.resume || !HasBegun({options.run_dir}))
    RETURN_IF_ERROR(CheckSeedBuffer(plan.config, plan.env));
  ASSIGN_OR_RETURN(plan.claim, Claim(options, plan.config, now));
  plan.folder = plan.claim->folder();
  plan.resume = !plan.claim->is_new();
  if (plan.resume) RETURN_IF_ERROR(CheckResumable(plan.folder, plan.config));
  plan.config_source = options.config.empty() ? plan.folder.config() : options.config;
  plan.replay_address = replay.address().empty() ? plan.folder.replay_address() : replay.address();
  plan.learner_address = learner.address().empty() ? plan.folder.learner_address() : learner.address();
  plan.actors = ActorProcesses(plan.config);
  RETURN_IF_ERROR(plan.claim->PutConfig(plan.config));
  return plan;
}

std::vector<ProcessSpec> Services(const RunPlan& plan, const std::string& programs) {
  std::vector<ProcessSpec> all = {
      MakeProcess(plan, programs, "replay", "dbr-replay", {"--address", plan.replay_address}, kStopReplay),
      MakeProcess(plan, programs, "learner", "dbr-learner",
                  {"--replay", plan.replay_address, "--address", plan.learner_address}, kStopLearner)};
  all[0].stop_grace = absl::Minutes(2);  // it brings the whole store to disk
  const bool insecure[] = {plan.config.replay().allow_insecure(), plan.config.learner().allow_insecure()};
  for (int i = 0; i < 2; ++i) {
    if (insecure[i]) all[i].command.push_back("--allow-insecure");
    if (plan.resume) all[i].command.push_back("--resume");
    all[i].restart_arguments = {"--resume"};
  }
  all.push_back(MakeActor(plan, programs, "evaluator", 0));
  all.back().command.push_back("--evaluate");
  if (plan.resume) all.back().command.push_back("--resume");
  all.back().restart_arguments = {"--resume"};
  return all;
}

std::vector<ProcessSpec> Actors(const RunPlan& plan, const std::string& programs) {
  std::vector<ProcessSpec> actors;
  actors.reserve(static_cast<std::size_t>(plan.actors));
  for (int i = 0; i < plan.actors; ++i)
    actors.push_back(MakeActor(plan, programs, absl::StrCat("actor-", i), i));
  return actors;
}

int DefaultActors(int cores) {
  return std::max(1, cores / 2);
}

absl::StatusOr<EnvSpec> EnvSpecOf(const Config& config) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv(TrainingEnv(config.env())));
  return env->spec();
}

absl::Status CheckFits(const Config& config, const EnvSpec& env) {
  RETURN_IF_ERROR(CheckServes(config.algorithm(), env.name, env.actions));
  RETURN_IF_ERROR(CheckMirror(config.algorithm(), env));
  RETURN_IF_ERROR(CheckExploration(env, config.actor()));
  const EvaluationConfig& evaluation = config.evaluation();
  RETURN_IF_ERROR(CheckMode(config, env, "actor.mode", config.actor().mode()));
  RETURN_IF_ERROR(CheckMode(config, env, "evaluation.mode", evaluation.mode()));
  RETURN_IF_ERROR(CheckEpisodes("evaluation.episodes", evaluation.episodes()));
  RETURN_IF_ERROR(CheckEpisodes("evaluation.final_episodes", evaluation.final_episodes()));
  RETURN_IF_ERROR(CheckOpponents(env.name, "evaluation.opponents", evaluation.opponents()));
  return CheckOpponents(env.name, "evaluation.final_opponents", evaluation.final_opponents());
}

int ActorProcesses(const Config& config) {
  if (TrainsOfflineAlone(config)) return 0;
  const int configured = static_cast<int>(config.actor().processes());
  return configured > 0 ? configured : DefaultActors(static_cast<int>(std::thread::hardware_concurrency()));
}

std::string AlgorithmName(const Config& config) {
  const auto* oneof = AlgorithmConfig::descriptor()->FindOneofByName("algorithm");
  const auto* chosen = config.algorithm().GetReflection()->GetOneofFieldDescriptor(config.algorithm(), oneof);
  return chosen == nullptr ? "dbr" : chosen->name();
}

}  // namespace dbr
