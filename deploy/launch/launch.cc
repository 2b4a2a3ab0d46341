#include "deploy/launch/launch.h"

#include <spdlog/sinks/basic_file_sink.h>

#include <filesystem>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "actor/evaluation_loop.h"
#include "actor/evaluator.h"
#include "core/file_io.h"
#include "core/monotonic_clock.h"
#include "core/safetensors.h"
#include "core/status_macros.h"
#include "deploy/launch/commit.h"
#include "deploy/launch/health.h"
#include "deploy/launch/result_tables.h"
#include "deploy/launch/results.h"
#include "deploy/launch/run_access.h"
#include "deploy/launch/summary_reader.h"
#include "deploy/process/interrupt.h"
#include "deploy/terminal/terminal.h"
#include "envs/registry/registry.h"
#include "nn/policy_choice.h"

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

std::string CountOfActors(int actors) {
  return absl::StrCat(actors, actors == 1 ? " actor" : " actors");
}

// What a launch says of itself before anything has happened, after what earlier ones of the run came to.
RunSummary BeginSummary(const RunPlan& plan) {
  RunSummary summary;
  if (plan.resume) summary = ReadSummary(plan.folder);
  summary.env = plan.config.env().name();
  summary.algorithm = AlgorithmName(plan.config);
  summary.seed = plan.config.seed();
  summary.config = plan.config_source;
  summary.commit = BuildCommit();
  summary.matrix_products.clear();  // until this launch's learner has told them
  summary.seed_buffer.path = plan.config.replay().seed_buffer().path();
  summary.offline_updates = plan.config.learner().offline_updates();
  summary.every_updates = plan.config.evaluation().every_updates();
  summary.ended = RunEnding::kRunning;
  summary.failure.clear();
  summary.final_results.clear();
  summary.final_policy.clear();
  ++summary.launches;
  return summary;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Launch>> Launch::Create(RunPlan plan, std::string programs, Output* out) {
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

Launch::Launch(RunPlan plan, std::string programs, Output* out, std::shared_ptr<spdlog::logger> log)
    : plan_(std::move(plan)),
      programs_(std::move(programs)),
      log_(std::move(log)),
      line_(out, kLineEvery),
      watch_(plan_.config, BeginSummary(plan_)) {}

const EnvPresentation& Launch::presentation() const {
  return PresentationOf(plan_.env.name);
}

absl::StatusOr<int> Launch::Run() {
  Announce();
  watch_.Start(MonotonicNow());
  absl::Status status = StartAll();
  if (!plan_.claim->has_begun()) return GiveUp(status);
  if (status.ok()) status = Train();
  line_.End();
  if (status.ok()) Say("stopping, and saving everything");
  const Stopped stopped = StopAll(/*ask=*/status.ok());
  if (status.ok()) return Conclude(stopped);
  watch_.Fail(status);
  log_->error("{}", summary().failure);
  if (plan_.claim->IsStillThere()) SaveSummary().IgnoreError();  // the failure is told
  return status;
}

absl::StatusOr<int> Launch::Conclude(const Stopped& stopped) {
  const std::string& log = plan_.folder.log("launch");
  Say(absl::StrCat(
      "training ended (", Reason(summary()), "): ", WithCommas(summary().games), " ", presentation().episodes,
      ", ", WithCommas(summary().transitions), " transitions, ", WithCommas(summary().updates),
      " updates in ", Clock(absl::Seconds(summary().training_s)),
      stopped.services_saved ? "; all is saved" : absl::StrCat("; NOT all could be saved, see ", log)));
  if (!summary().matrix_products.empty())
    Say(absl::StrCat("the learner multiplied with ", summary().matrix_products));
  if (stopped.services_saved && !stopped.actors_ended)
    Say(absl::StrCat("an actor or the evaluator did not end by itself, see ", log));
  bool interrupted = stopped.by_signal;
  if (!stopped.services_saved && !interrupted) {
    // A table of the policy that was saved before would not be this run's.
    const absl::Status lost = absl::AbortedError(absl::StrCat(
        "not all could be saved when the run ended. Go on from its last checkpoint with: dbr launch ",
        "--resume --run-dir ", plan_.folder.root));
    watch_.Fail(lost);
    RETURN_IF_ERROR(SaveSummary());
    return lost;
  }
  RETURN_IF_ERROR(SaveSummary());
  if (!interrupted) RETURN_IF_ERROR(FinalEvaluation(&interrupted));
  if (interrupted) {
    if (HasPolicy())
      Say(absl::StrCat("no final table; it comes with: dbr evaluate --policy ", plan_.folder.root));
    Say(absl::StrCat("continue with: dbr launch --resume --run-dir ", plan_.folder.root));
  }
  Say(absl::StrCat("run folder: ", plan_.folder.root));
  return interrupted ? kInterruptedExit : 0;
}

absl::StatusOr<int> Launch::GiveUp(const absl::Status& why) {
  line_.End();
  StopAll(/*ask=*/false);
  plan_.claim->Withdraw();
  if (!plan_.resume) {
    why.ok() ? watch_.Interrupt() : watch_.Fail(why);
    SaveSummary().IgnoreError();  // there is nothing in it to be lost
  }
  if (!why.ok()) {
    log_->error("{}", std::string(why.message()));
    return why;
  }
  Say(absl::StrCat("stopped before the run ",
                   plan_.resume ? "went on: its results are as they were" : "began",
                   "; the same command starts it\nrun folder: ", plan_.folder.root));
  return kInterruptedExit;
}

void Launch::Announce() {
  Say(absl::StrCat(plan_.resume ? "continuing " : "training ", summary().algorithm, " on ", summary().env,
                   ", seed ", summary().seed, ", ",
                   plan_.actors == 0 ? "no actors" : CountOfActors(plan_.actors), ", until ",
                   watch_.limits().Text(presentation().episodes), "; Ctrl-C stops and saves"));
  Say(absl::StrCat("run folder: ", plan_.folder.root));
  const std::string& seed_buffer = summary().seed_buffer.path;
  if (!seed_buffer.empty()) Say(absl::StrCat("seed buffer: ", seed_buffer));
  if (plan_.resume) TellWhatIsLost();
}

void Launch::TellWhatIsLost() {
  std::error_code unreadable;
  if (std::filesystem::is_empty(plan_.folder.checkpoints(), unreadable)) {
    Say(absl::StrCat("no checkpoint in ", plan_.folder.checkpoints(),
                     ": the learner starts from nothing, with the transitions that are there"));
  }
  if (!std::filesystem::exists(plan_.folder.summary(), unreadable)) {
    Say(absl::StrCat("no ", plan_.folder.summary(),
                     ": the run counts its seconds, restarts and evaluations from nothing"));
  }
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
      summary().seed_buffer.path.empty() ? kServingWithin : kServingSeedBufferWithin;
  for (ProcessSpec& process : Services(plan_, programs_)) {
    const std::string name = process.name;
    RETURN_IF_ERROR(supervisor_->Start(std::move(process)));
    if (name == "replay") RETURN_IF_ERROR(WaitUntilServing(name, plan_.replay_address, replay_within));
    if (name == "learner") RETURN_IF_ERROR(WaitUntilServing(name, plan_.learner_address, kServingWithin));
    if (supervisor_->stop_signals() > 0) return absl::OkStatus();
  }
  RETURN_IF_ERROR(plan_.claim->Begin());
  if (summary().offline_updates == 0) RETURN_IF_ERROR(StartActors());
  supervisor_->set_restarting(true);
  monitor_ = std::make_unique<RunMonitor>(plan_.replay_address, plan_.learner_address, kAskEvery,
                                          [supervisor = supervisor_.get()] { supervisor->Wake(); });
  watch_.StartTraining(MonotonicNow());
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
  watch_.Count(monitor_->Ask(kFirstAnswerWithin));
  const SeedBufferSummary& seed_buffer = summary().seed_buffer;
  if (seed_buffer.rows == 0) return;
  Say(absl::StrCat("the seed buffer holds ", WithCommas(seed_buffer.rows), " transitions, ",
                   WithCommas(seed_buffer.episodes), " whole episodes with a mean return of ",
                   Fixed(seed_buffer.return_mean, 1), " ± ", Fixed(seed_buffer.return_std, 1),
                   "; it was loaded at ", Compact(seed_buffer.rows_per_second), " rows/s"));
  if (seed_buffer.bad_rows > 0)
    Say(absl::StrCat(WithCommas(seed_buffer.bad_rows),
                     " bad rows (a value is not finite, or a flag neither 0 nor 1) are left out"));
  for (const std::string& warning : SeedBufferWarnings(seed_buffer)) Say(warning);
}

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

absl::Status Launch::Train() {
  while (supervisor_->stop_signals() == 0) {
    const absl::Time now = MonotonicNow();
    const RunSample sample = monitor_->Take();
    Observe(sample, now);
    RETURN_IF_ERROR(sample.refusal);
    RETURN_IF_ERROR(SaveIfDue(now));
    if (summary().ended != RunEnding::kRunning) return absl::OkStatus();
    if (!acting_ && watch_.limits().OfflinePhaseIsOver(sample)) {
      Say(absl::StrCat("offline phase over after ", WithCommas(summary().updates), " updates: starting ",
                       CountOfActors(plan_.actors)));
      RETURN_IF_ERROR(StartActors());
    }
    // The monitor wakes us, too.
    RETURN_IF_ERROR(supervisor_->Wait(watch_.limits().Deadline(summary(), now)));
  }
  watch_.Interrupt();
  return absl::OkStatus();
}

void Launch::Observe(const RunSample& sample, absl::Time now) {
  watch_.Observe(sample, supervisor_->restarts(), now);
  if (sample.learner.has_value() && !sample.learner->finetuning().empty() &&
      !std::exchange(said_finetuning_, true)) {
    Say(sample.learner->finetuning());
  }
  if (sample.replay.has_value()) {
    line_.Update({.sample = sample,
                  .left = watch_.TimeLeft(sample),
                  .presentation = presentation(),
                  .offline_updates = acting_ ? 0 : summary().offline_updates},
                 now);
  }
}

absl::Status Launch::SaveIfDue(absl::Time now) {
  if (!watch_.IsDueToBeSaved(now)) return absl::OkStatus();
  watch_.CountWallTime(now);
  if (!plan_.claim->IsStillThere()) {
    return absl::FailedPreconditionError(absl::StrCat("run folder '", plan_.folder.root,
                                                      "' was moved or removed while the run was at work. ",
                                                      "Move it back and go on with --resume."));
  }
  if (const absl::Status saved = SaveSummary(); !saved.ok()) log_->warn("{}", std::string(saved.message()));
  return absl::OkStatus();
}

// Actors first; then what the services count is final and, where `ask` is set, noted; then the services.
Launch::Stopped Launch::StopAll(bool ask) {
  if (supervisor_ == nullptr) return {};
  Stopped stopped;
  stopped.actors_ended = supervisor_->Stop(kStopActors);
  if (monitor_ != nullptr) watch_.Count(ask ? monitor_->Ask(kLastAnswerWithin) : monitor_->Take());
  monitor_.reset();
  stopped.services_saved = supervisor_->Stop();
  // The learner trained on between its last answer and its last save.
  if (const auto policy = LoadPolicy(plan_.folder.latest_policy()); stopped.services_saved && policy.ok())
    watch_.CountSaved(*policy);
  stopped.by_signal = supervisor_->stop_signals() > 0;
  supervisor_.reset();
  watch_.CountWallTime(MonotonicNow());
  return stopped;
}

bool Launch::HasPolicy() const {
  std::error_code unreadable;
  return std::filesystem::exists(plan_.folder.latest_policy(), unreadable);
}

absl::Status Launch::FinalEvaluation(bool* interrupted) {
  if (!HasPolicy()) {
    Say("no final table: the learner had no policy to save yet");
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const auto newest, OpenPolicy(plan_.folder.latest_policy()));
  const EvaluationConfig& config = plan_.config.evaluation();
  const PolicyChoice played = ServedChoice(newest->snapshot(), config.which());
  const auto policy = WithActing(newest, played);
  const std::vector<std::string> opponents =
      OpponentsToEvaluate(summary().env, {config.final_opponents().begin(), config.final_opponents().end()});
  Say(absl::StrCat("\nfinal evaluation of policy ", policy->snapshot().version, ", ", NameOf(played), " (",
                   plan_.folder.latest_policy(), "):"));
  const Interrupt interrupt;
  absl::StatusOr<std::vector<EvaluationResult>> results =
      EvaluateAgainst(*policy, opponents,
                      {.opponent = "",
                       .episodes = static_cast<int>(config.final_episodes()),
                       .seed = plan_.config.seed(),
                       .mode = config.mode()},
                      &interrupt.flag());
  *interrupted = absl::IsCancelled(results.status());
  if (*interrupted) return absl::OkStatus();
  RETURN_IF_ERROR(results.status());
  watch_.SetFinalResults(*std::move(results), NameOf(played));
  RETURN_IF_ERROR(SaveSummary());
  std::string table = ResultTable(summary().final_results);
  if (const std::string returns = ReturnsTable(summary()); !returns.empty())
    absl::StrAppend(&table, "\n", returns);
  Say(table);
  return WriteFileAtomically(ResultsPath(plan_.folder), table);
}

void Launch::Say(const std::string& text) {
  line_.Say(text);
  log_->info("{}", text);
}

absl::Status Launch::SaveSummary() {
  return WriteSummary(summary(), plan_.folder);
}

}  // namespace dbr
