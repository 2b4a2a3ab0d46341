#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numeric>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "actor/policy_fit.h"
#include "core/monotonic_clock.h"
#include "core/rng.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"
#include "deploy/cli/common_options.h"
#include "deploy/cli/dataset_command.h"
#include "deploy/cli/shipped_file.h"
#include "deploy/launch/run_access.h"
#include "deploy/manual/number_option.h"
#include "deploy/record/recorder.h"
#include "deploy/record/store_episodes.h"
#include "deploy/terminal/progress_bar.h"
#include "deploy/terminal/terminal.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "nn/product/blas_setup.h"
#include "replay/dataset/dataset_writer.h"

namespace dbr {
namespace {

constexpr std::int64_t kMaxSteps = 1'000'000'000;
constexpr std::uint64_t kMaxShare = 1'000'000;

struct RecordFlags {
  std::string env;
  std::string quality;
  std::int64_t steps = 0;  // 0: not given
  std::string out;
  std::uint64_t seed = 1;
  std::string layout = "d4rl";
  std::vector<std::string> policies;
  std::vector<std::uint64_t> shares;  // of the policies, as parts of their sum; empty: all the same
  std::string acting;                 // empty: not given
  std::string run;
};

absl::Status CheckMixture(const RecordFlags& flags) {
  if (flags.policies.size() < 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("--policy: expected two policies or more with --quality mixture, found ",
                     flags.policies.size(), ". A run keeps policies with learner.keep_policy_every."));
  }
  if (!flags.shares.empty() && flags.shares.size() != flags.policies.size()) {
    return absl::InvalidArgumentError(absl::StrCat("--share: expected one for each of the ",
                                                   flags.policies.size(), " policies, or none, found ",
                                                   flags.shares.size()));
  }
  if (flags.steps < static_cast<std::int64_t>(flags.policies.size())) {
    return absl::InvalidArgumentError(absl::StrCat("--steps: expected one for each of the ",
                                                   flags.policies.size(), " policies at least, found ",
                                                   flags.steps));
  }
  return absl::OkStatus();
}

absl::Status CheckFlags(const RecordFlags& flags, const EnvSpec& env) {
  const bool mixed = flags.quality == "mixed", medium = flags.quality == "medium",
             mixture = flags.quality == "mixture";
  const auto refuse = [](absl::string_view message) { return absl::InvalidArgumentError(message); };
  if (!mixed && !medium && !mixture && flags.quality != "random") {
    return refuse(
        absl::StrCat("--quality: expected random, medium, mixture or mixed, found '", flags.quality, "'"));
  }
  if (!mixed && flags.steps == 0)
    return refuse(
        absl::StrCat("--steps: expected a number of steps to record with --quality ", flags.quality));
  if (mixture) RETURN_IF_ERROR(CheckMixture(flags));
  if (!medium && !mixture && !flags.policies.empty()) {
    return refuse(absl::StrCat("--policy: expected with --quality medium or mixture alone, found with ",
                               flags.quality));
  }
  if (medium && flags.policies.size() > 1) {
    return refuse(absl::StrCat("--policy: expected one with --quality medium, found ", flags.policies.size(),
                               ". Take --quality mixture for several."));
  }
  if (!mixture && !flags.shares.empty()) {
    return refuse(absl::StrCat("--share: expected with --quality mixture alone, found with ", flags.quality));
  }
  if (!medium && !mixture && !flags.acting.empty()) {
    return refuse(absl::StrCat("--acting: expected with --quality medium or mixture alone, found with ",
                               flags.quality));
  }
  if (!mixed && !flags.run.empty()) {
    return refuse(absl::StrCat("--run: expected with --quality mixed alone, found with ", flags.quality));
  }
  if (mixed && flags.run.empty()) {
    return refuse(absl::StrCat(
        "--quality mixed is all that a training run saw: name the run's folder with --run. Such ",
        "a run is made by: dbr launch deploy/configs/", env.name, "_medium.textproto"));
  }
  return absl::OkStatus();
}

std::unique_ptr<ProgressBar> MakeBar(const RecordFlags& flags, const EnvSpec& env, std::int64_t steps) {
  BarState state;
  state.label = absl::StrCat(env.name, " ", flags.quality);
  state.unit = "steps";
  state.total = steps;
  return std::make_unique<ProgressBar>(stderr, state, MonotonicNow(), kProgressEvery);
}

using PolicyPtr = std::shared_ptr<const PolicyNetworks>;

absl::StatusOr<PolicyPtr> MediumPolicy(const EnvSpec& env) {
  const absl::StatusOr<std::string> path =
      FindShippedFile(absl::StrCat("deploy/policies/", env.name, "_medium.safetensors"));
  if (path.ok()) return OpenPolicy(*path);
  return absl::NotFoundError(absl::StrCat(path.status().message(),
                                          ". Name a policy with --policy, or train one: dbr ",
                                          "launch deploy/configs/", env.name, "_medium.textproto"));
}

// The named policies, each of which fits the environment.
absl::StatusOr<std::vector<PolicyPtr>> NamedPolicies(const RecordFlags& flags, const EnvSpec& env) {
  std::vector<PolicyPtr> policies;
  for (const std::string& name : flags.policies) {
    ASSIGN_OR_RETURN(policies.emplace_back(), OpenNamedPolicy(name));
    if (const absl::Status fits = CheckPolicyFits(policies.back()->spec(), env); !fits.ok()) {
      return absl::Status(fits.code(), absl::StrCat("--policy ", name, ": ", fits.message()));
    }
  }
  return policies;
}

// The recordings that make up the file, one after another: of each policy its share of the steps.
absl::StatusOr<std::vector<RecordOptions>> Recordings(const RecordFlags& flags, const EnvSpec& env) {
  RecordOptions all{.env = env.name, .policy = nullptr, .steps = flags.steps, .seed = flags.seed};
  if (flags.quality == "random") return std::vector<RecordOptions>{all};
  if (!flags.acting.empty()) {
    ASSIGN_OR_RETURN(all.acting, ParseActingMode(flags.acting));
  }
  ASSIGN_OR_RETURN(std::vector<PolicyPtr> policies, NamedPolicies(flags, env));
  if (policies.empty()) {
    ASSIGN_OR_RETURN(policies.emplace_back(), MediumPolicy(env));
  }
  std::vector<std::uint64_t> shares = flags.shares;
  shares.resize(policies.size(), 1);
  const auto whole = static_cast<double>(std::accumulate(shares.begin(), shares.end(), std::uint64_t{0}));
  std::vector<RecordOptions> recordings(policies.size(), all);
  double until = 0;
  std::int64_t given = 0;
  for (std::size_t i = 0; i < policies.size(); ++i) {
    until += static_cast<double>(shares[i]);
    const auto end =
        static_cast<std::int64_t>(std::llround(static_cast<double>(flags.steps) * until / whole));
    recordings[i].policy = policies[i];
    recordings[i].steps = end - given;
    if (i > 0) recordings[i].seed = Rng(flags.seed).Fork(i)();
    given = end;
    if (recordings[i].steps < 1) {
      return absl::InvalidArgumentError(absl::StrCat("--share: expected at least one of the ", flags.steps,
                                                     " steps for each policy, found none for ",
                                                     flags.policies[i]));
    }
  }
  return recordings;
}

absl::Status RecordPlay(const RecordFlags& flags, const EnvSpec& env,
                        const std::vector<RecordOptions>& recordings, DatasetWriter* writer,
                        const Interrupt& interrupt) {
  const std::unique_ptr<ProgressBar> bar = MakeBar(flags, env, flags.steps);
  std::int64_t before = 0;
  const RecordSinks sinks = {
      .episode = [&](const EpisodeView& episode) { return writer->Append(episode); },
      .progress = [&](std::int64_t steps) { bar->Update(before + steps, MonotonicNow()); }};
  for (const RecordOptions& recording : recordings) {
    RETURN_IF_ERROR(RecordEpisodes(recording, sinks, interrupt.flag()));
    before += recording.steps;
  }
  return absl::OkStatus();
}

absl::Status RecordRun(const RecordFlags& flags, const RunStore& run, DatasetWriter* writer,
                       const Interrupt& interrupt) {
  const std::vector<StoreEpisode> episodes = LinkEpisodes(*run.store, run.env.max_episode_steps);
  std::int64_t held = 0;
  for (const StoreEpisode& episode : episodes) held += static_cast<std::int64_t>(episode.slots.size());
  if (flags.steps > held || held == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--steps: expected at most what the run's store holds of its own, ", held,
                     " transitions, found ", flags.steps));
  }
  std::int64_t left = flags.steps > 0 ? flags.steps : held;
  const std::unique_ptr<ProgressBar> bar = MakeBar(flags, run.env, left);
  std::int64_t written = 0;
  for (const StoreEpisode& episode : episodes) {
    if (interrupt.flag()) return absl::CancelledError("the recording was stopped");
    const std::size_t steps = std::min<std::size_t>(left, episode.slots.size());
    if (steps == 0) break;
    RETURN_IF_ERROR(writer->Append(CopyEpisode(*run.store, episode, steps).View()));
    left -= static_cast<std::int64_t>(steps);
    bar->Update(written += static_cast<std::int64_t>(steps), MonotonicNow());
  }
  const std::uint64_t evicted = run.store->inserted() - run.store->size();
  if (evicted > 0) {
    std::fprintf(stderr,
                 "dbr dataset record: the run's oldest %s transitions were evicted and are missing; a run "
                 "with a larger "
                 "replay.capacity keeps all\n",
                 WithCommas(evicted).c_str());
  }
  return absl::OkStatus();
}

absl::StatusOr<RunStore> OpenRunOf(const RecordFlags& flags, const EnvSpec& env) {
  ASSIGN_OR_RETURN(RunStore run, OpenRunStore(flags.run));
  if (run.env.name == env.name) return run;
  return absl::InvalidArgumentError(absl::StrCat("--run: expected a run of ", env.name, ", found one of ",
                                                 run.env.name,
                                                 "; name that environment with --env, or another run"));
}

absl::Status Record(const RecordFlags& flags, const Interrupt& interrupt) {
  ASSIGN_OR_RETURN(const std::optional<DatasetLayout> layout, ParseLayoutOption("--layout", flags.layout));
  RETURN_IF_ERROR(CheckBlasMemory(static_cast<int>(std::thread::hardware_concurrency())));
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv({.name = flags.env, .opponents = {}}));
  RETURN_IF_ERROR(CheckFlags(flags, env->spec()));
  const DatasetWriterOptions options{.layout = layout.value_or(DatasetLayout::kD4rl), .env = env->spec()};
  if (flags.run.empty()) {
    ASSIGN_OR_RETURN(const std::vector<RecordOptions> recordings, Recordings(flags, env->spec()));
    ASSIGN_OR_RETURN(const std::unique_ptr<DatasetWriter> writer, DatasetWriter::Create(flags.out, options));
    RETURN_IF_ERROR(RecordPlay(flags, env->spec(), recordings, writer.get(), interrupt));
    return writer->Finish();
  }
  ASSIGN_OR_RETURN(const RunStore run, OpenRunOf(flags, env->spec()));
  ASSIGN_OR_RETURN(const std::unique_ptr<DatasetWriter> writer, DatasetWriter::Create(flags.out, options));
  RETURN_IF_ERROR(RecordRun(flags, run, writer.get(), interrupt));
  return writer->Finish();
}

absl::StatusOr<int> RunRecord(const RecordFlags& flags) {
  const Interrupt interrupt;
  const absl::Time start = MonotonicNow();
  const absl::Status recorded = Record(flags, interrupt);
  if (absl::IsCancelled(recorded)) return kInterruptedExit;
  RETURN_IF_ERROR(recorded);
  const double seconds = absl::ToDoubleSeconds(MonotonicNow() - start);
  const absl::StatusOr<DatasetReport> report = ReportDataset(flags.out, std::nullopt, interrupt);
  if (absl::IsCancelled(report.status())) return kInterruptedExit;
  RETURN_IF_ERROR(report.status());
  std::printf("%s  %s in %s s, %s steps/s\n", DatasetText(*report).c_str(), PadRight("recorded", 12).c_str(),
              Fixed(seconds, 1).c_str(),
              Compact(static_cast<double>(report->facts.transitions) / seconds).c_str());
  return 0;
}

}  // namespace

void AddDatasetRecord(CLI::App* dataset, int* exit_code) {
  auto flags = std::make_shared<RecordFlags>();
  CLI::App* command = dataset->add_subcommand("record", "Record a robot's steps on every core");
  command->add_option("--env", flags->env, "The robot to record")->required()->type_name(kRobotNames);
  command
      ->add_option("--quality", flags->quality,
                   "random: uniform actions; medium: a trained policy; mixture: several, one after another; "
                   "mixed: all that "
                   "a run saw")
      ->required()
      ->type_name("random|medium|mixture|mixed");
  command
      ->add_option("--steps", flags->steps, "Transitions to record [mixed: all that the run's store holds]")
      ->transform(WholeNumber(1, kMaxSteps))
      ->type_name("N");
  command
      ->add_option("--out", flags->out,
                   "The HDF5 file to write; an old one is replaced when the new one is whole")
      ->required()
      ->type_name("FILE");
  AddSeedOption(command, "Random seed: the same one records the same steps, on any number of cores",
                &flags->seed);
  command->add_option("--layout", flags->layout, "Layout of the file")
      ->capture_default_str()
      ->type_name(kWrittenLayoutNames);
  command
      ->add_option("--policy", flags->policies,
                   "medium: a policy file or a run folder, of which the raw policy plays "
                   "[deploy/policies/ENV_medium.safetensors]; mixture: two or more of them")
      ->type_name("FILE_OR_RUN");
  command
      ->add_option("--share", flags->shares,
                   "mixture: how many parts of the steps each policy plays, in their order [1 each]")
      ->transform(WholeNumber(1, kMaxShare))
      ->type_name("N");
  command
      ->add_option("--acting", flags->acting,
                   "medium, mixture: whether the policy samples its actions or takes its mean [mode]")
      ->type_name("sample|mode");
  command->add_option("--run", flags->run, "mixed: the folder of the training run")->type_name("DIR");
  command->footer(
      "Examples:\n"
      "  dbr dataset record --env hopper --quality medium --steps 1000000 --out hopper_medium.hdf5\n"
      "  dbr dataset record --env hopper --quality mixture --policy runs/hopper/policy/20000.safetensors "
      "--share 1 "
      "--policy runs/hopper/policy/60000.safetensors --share 3 --acting sample --steps 1000000 --out "
      "hopper_mixture.hdf5\n"
      "  dbr dataset record --env hopper --quality mixed --run runs/hopper --out hopper_mixed.hdf5");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunRecord(*flags);
    *exit_code = result.ok() ? *result : Fail("dataset record", result.status());
  });
}

}  // namespace dbr
