#include "deploy/launch/launch.h"

#include <spdlog/sinks/basic_file_sink.h>

#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "actor/evaluation_loop.h"
#include "core/file_io.h"
#include "core/safetensors.h"
#include "core/status_macros.h"
#include "deploy/launch/commit.h"
#include "deploy/launch/result_tables.h"
#include "deploy/launch/results.h"
#include "deploy/launch/summary_reader.h"
#include "deploy/process/interrupt.h"
#include "deploy/terminal/terminal.h"
#include "nn/policy.h"

namespace dbr {
namespace {

constexpr absl::Duration kAskEvery = absl::Milliseconds(500);
constexpr absl::Duration kLineEvery = absl::Seconds(10);     // where the output is no terminal
constexpr absl::Duration kServingWithin = absl::Minutes(2);  // a large store takes its time to be opened
constexpr absl::Duration kServingSeedBufferWithin = absl::Minutes(10);
constexpr absl::Duration kFirstAnswerWithin = absl::Seconds(10);
constexpr absl::Duration kLastAnswerWithin = absl::Seconds(2);

SupervisorOptions OptionsOf(const LaunchConfig& config) {
  SupervisorOptions options;
  options.max_restarts = config.max_restarts();
  options.restart_window = absl::Seconds(config.restart_window_s());
  return options;
}

// Why a run ended, for people.
std::string Reason(const RunSummary& summary) {
  if (summary.ended == RunEnding::kInterrupted) return "stopped by a signal";
  return absl::StrCat("reached ", TextOf(summary.ended));
}

const char* EpisodesWord(const EnvSpec& env) {
  return env.has_score ? " games" : " episodes";
}

// What ends the run, for people.
std::string Until(const Config& config, const EnvSpec& env) {
  const LaunchConfig& limits = config.launch();
  std::vector<std::string> until;
  if (limits.max_seconds() > 0) until.push_back(Clock(absl::Seconds(limits.max_seconds())));
  if (limits.max_episodes() > 0)
    until.push_back(absl::StrCat(WithCommas(limits.max_episodes()), EpisodesWord(env)));
  if (limits.max_steps() > 0) until.push_back(absl::StrCat(WithCommas(limits.max_steps()), " online steps"));
  const std::uint64_t updates = config.learner().max_updates();
  if (updates > 0) until.push_back(absl::StrCat(WithCommas(updates), " updates"));
  if (limits.stop_at_return() != 0)
    until.push_back(absl::StrCat("an evaluated return of ", limits.stop_at_return()));
  return until.empty() ? "it is stopped" : absl::StrJoin(until, " or ");
}

}  // namespace

absl::StatusOr<std::unique_ptr<Launch>> Launch::Create(RunPlan plan, std::string programs, std::FILE* out) {
  std::shared_ptr<spdlog::logger> log;
  try {
    log = std::make_shared<spdlog::logger>(
        "launch", std::make_shared<spdlog::sinks::basic_file_sink_mt>(plan.folder.log("launch")));
  } catch (const spdlog::spdlog_ex& error) {
    return absl::InternalError(error.what());
  }
  log->flush_on(spdlog::level::info);
  return std::unique_ptr<Launch>(new Launch(std::move(plan), std::move(programs), out, std::move(log)));
}

Launch::Launch(RunPlan plan, std::string programs, std::FILE* out, std::shared_ptr<spdlog::logger> log)
    : plan_(std::move(plan)), programs_(std::move(programs)), log_(std::move(log)), line_(out, kLineEvery) {
  if (plan_.resume) before_ = ReadSummary(plan_.folder);
  summary_ = before_;
  summary_.env = plan_.config.env().name();
  summary_.algorithm = AlgorithmName(plan_.config);
  summary_.seed = plan_.config.seed();
  summary_.config = plan_.config_source;
  summary_.commit = BuildCommit();
  summary_.seed_buffer.path = plan_.config.replay().seed_buffer().path();
  summary_.offline_updates = plan_.config.learner().offline_updates();
  summary_.every_updates = plan_.config.evaluation().every_updates();
  summary_.ended = RunEnding::kRunning;
  summary_.failure.clear();
  summary_.final_results.clear();
  ++summary_.launches;
}

absl::StatusOr<int> Launch::Run() {
  Announce();
  started_ = absl::Now();
  absl::Status status = StartAll();
  if (status.ok()) status = Train();
  line_.End();
  if (status.ok()) Say("stopping, and saving everything");
  const bool saved = StopAll(/*ask=*/status.ok());
  if (!status.ok()) {
    summary_.ended = RunEnding::kFailed;
    summary_.failure = std::string(status.message());
    log_->error("{}", summary_.failure);
    SaveSummary();
    return status;
  }
  SaveSummary();
  Say(absl::StrCat(
      "training ended (", Reason(summary_), "): ", WithCommas(summary_.games), EpisodesWord(plan_.env), ", ",
      WithCommas(summary_.transitions), " transitions, ", WithCommas(summary_.updates), " updates in ",
      Clock(absl::Seconds(summary_.training_s)),
      saved ? "; all is saved" : absl::StrCat("; NOT all could be saved, see ", plan_.folder.log("launch"))));
  bool interrupted = summary_.ended == RunEnding::kInterrupted;
  if (!interrupted) RETURN_IF_ERROR(FinalEvaluation(&interrupted));
  if (interrupted) {
    Say(absl::StrCat("no final table; it comes with: dbr evaluate --policy ", plan_.folder.root,
                     "\ncontinue with: dbr launch --resume --run-dir ", plan_.folder.root));
  }
  Say(absl::StrCat("run folder: ", plan_.folder.root));
  return interrupted ? kInterruptedExit : 0;
}

void Launch::Announce() {
  const std::string actors =
      plan_.actors == 0 ? "no actors" : absl::StrCat(plan_.actors, plan_.actors == 1 ? " actor" : " actors");
  Say(absl::StrCat(plan_.resume ? "continuing " : "training ", summary_.algorithm, " on ", summary_.env,
                   ", seed ", summary_.seed, ", ", actors, ", until ", Until(plan_.config, plan_.env),
                   "; Ctrl-C stops and saves"));
  Say(absl::StrCat("run folder: ", plan_.folder.root));
  if (!summary_.seed_buffer.path.empty()) Say(absl::StrCat("seed buffer: ", summary_.seed_buffer.path));
}

absl::Status Launch::StartAll() {
  SupervisorOptions options = OptionsOf(plan_.config.launch());
  options.on_event = [this](const std::string& event, bool notable) {
    notable ? log_->warn("{}", event) : log_->info("{}", event);
    if (notable) line_.Say(event);
  };
  ASSIGN_OR_RETURN(supervisor_, Supervisor::Create(std::move(options)));
  supervisor_->set_restarting(false);
  const absl::Duration replay_within =
      summary_.seed_buffer.path.empty() ? kServingWithin : kServingSeedBufferWithin;
  for (ProcessSpec& process : Services(plan_, programs_)) {
    const std::string name = process.name;
    RETURN_IF_ERROR(supervisor_->Start(std::move(process)));
    if (name == "replay") RETURN_IF_ERROR(WaitUntilServing(name, plan_.replay_address, replay_within));
    if (name == "learner") RETURN_IF_ERROR(WaitUntilServing(name, plan_.learner_address, kServingWithin));
    if (supervisor_->stop_signals() > 0) return absl::OkStatus();
  }
  if (summary_.offline_updates == 0) RETURN_IF_ERROR(StartActors());
  supervisor_->set_restarting(true);
  monitor_ = std::make_unique<RunMonitor>(plan_.replay_address, plan_.learner_address, kAskEvery,
                                          [supervisor = supervisor_.get()] { supervisor->Wake(); });
  training_since_ = absl::Now();
  TellOfTheSeedBuffer();
  return absl::OkStatus();
}

absl::Status Launch::StartActors() {
  acting_ = true;
  for (ProcessSpec& process : Actors(plan_, programs_))
    RETURN_IF_ERROR(supervisor_->Start(std::move(process)));
  return absl::OkStatus();
}

void Launch::TellOfTheSeedBuffer() {
  summary_.Update(monitor_->Ask(kFirstAnswerWithin));
  const SeedBufferSummary& seed_buffer = summary_.seed_buffer;
  if (seed_buffer.rows == 0) return;
  Say(absl::StrCat("the seed buffer holds ", WithCommas(seed_buffer.rows), " transitions, ",
                   WithCommas(seed_buffer.episodes), " whole episodes with a mean return of ",
                   Fixed(seed_buffer.return_mean, 1), " ± ", Fixed(seed_buffer.return_std, 1),
                   "; it was loaded at ", Compact(seed_buffer.rows_per_second), " rows/s"));
  if (seed_buffer.bad_rows > 0)
    Say(absl::StrCat(WithCommas(seed_buffer.bad_rows), " rows with values that are not finite are left out"));
}

// OK also where a stop signal came first.
absl::Status Launch::WaitUntilServing(const std::string& name, const std::string& address,
                                      absl::Duration within) {
  const HealthCheck check(address, within, [supervisor = supervisor_.get()] { supervisor->Wake(); });
  while (supervisor_->stop_signals() == 0) {
    if (const std::optional<absl::Status> result = check.result()) {
      if (result->ok()) return absl::OkStatus();
      return absl::Status(result->code(),
                          absl::StrCat(name, " does not serve within ", absl::FormatDuration(within), ": ",
                                       result->message(), "\n  its log: ", plan_.folder.log(name)));
    }
    RETURN_IF_ERROR(supervisor_->Wait(absl::InfiniteFuture()));
  }
  return absl::OkStatus();
}

// Actors first; then what the services count is final and, where `ask` is set, noted; then the services. True
// where every process ended by itself and without an error.
bool Launch::StopAll(bool ask) {
  if (supervisor_ == nullptr) return false;
  bool clean = supervisor_->Stop(kStopActors);
  if (ask && monitor_ != nullptr) summary_.Update(monitor_->Ask(kLastAnswerWithin));
  monitor_.reset();
  clean = supervisor_->Stop() && clean;
  supervisor_.reset();
  summary_.wall_s = before_.wall_s + absl::ToDoubleSeconds(absl::Now() - started_);
  return clean;
}

absl::Status Launch::FinalEvaluation(bool* interrupted) {
  if (!std::filesystem::exists(plan_.folder.latest_policy())) {
    Say("no final table: the learner had no policy to save yet");
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(PolicySnapshot snapshot, LoadPolicy(plan_.folder.latest_policy()));
  const std::uint64_t version = snapshot.version;
  ASSIGN_OR_RETURN(const auto policy, PolicyNetworks::Create(std::move(snapshot)));
  const EvaluationConfig& config = plan_.config.evaluation();
  const std::vector<std::string> opponents =
      OpponentsToEvaluate(summary_.env, {config.final_opponents().begin(), config.final_opponents().end()});
  Say(absl::StrCat("\nfinal evaluation of policy ", version, " (", plan_.folder.latest_policy(), "):"));
  const Interrupt interrupt;
  for (const std::string& opponent : opponents) {
    const EvaluationOptions options{.opponent = opponent,
                                    .episodes = static_cast<int>(config.final_episodes()),
                                    .seed = plan_.config.seed(),
                                    .mode = config.mode()};
    absl::StatusOr<EvaluationResult> result = Evaluate(*policy, options, &interrupt.flag());
    if (absl::IsCancelled(result.status())) {
      *interrupted = true;
      return absl::OkStatus();
    }
    RETURN_IF_ERROR(result.status());
    summary_.final_results.push_back(*std::move(result));
  }
  SaveSummary();
  std::string table = ResultTable(summary_.final_results);
  if (const std::string returns = ReturnsTable(summary_); !returns.empty())
    absl::StrAppend(&table, "\n", returns);
  Say(table);
  return WriteFileAtomically(ResultsPath(plan_.folder), table);
}

void Launch::Say(const std::string& text) {
  line_.Say(text);
  log_->info("{}", text);
}

void Launch::SaveSummary() {
  if (supervisor_ != nullptr)
    summary_.wall_s = before_.wall_s + absl::ToDoubleSeconds(absl::Now() - started_);
  const absl::Status written = WriteSummary(summary_, plan_.folder);
  if (!written.ok()) log_->warn("{}", std::string(written.message()));
}

}  // namespace dbr
