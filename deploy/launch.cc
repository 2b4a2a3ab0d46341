#include "deploy/launch.h"

#include <spdlog/sinks/basic_file_sink.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "actor/evaluation_loop.h"
#include "core/file_io.h"
#include "core/safetensors.h"
#include "core/status_macros.h"
#include "deploy/interrupt.h"
#include "deploy/terminal.h"
#include "nn/policy.h"

namespace dbr {
namespace {

constexpr absl::Duration kAskEvery = absl::Milliseconds(500);
constexpr absl::Duration kLineEvery = absl::Seconds(10);  // where the output is no terminal
constexpr absl::Duration kSummaryEvery = absl::Seconds(10);
constexpr absl::Duration kServingWithin = absl::Minutes(2);  // a large store takes its time to be opened
constexpr absl::Duration kLastAnswerWithin = absl::Seconds(2);

SupervisorOptions OptionsOf(const LaunchConfig& config) {
  SupervisorOptions options;
  options.max_restarts = config.max_restarts();
  options.restart_window = absl::Seconds(config.restart_window_s());
  return options;
}

// Why a run ended, for people.
std::string Reason(const RunSummary& summary) {
  if (summary.ended == "interrupted") return "stopped by a signal";
  return absl::StrCat("reached ", summary.ended);
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
  summary_.ended = "running";
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
    summary_.ended = "failed";
    summary_.failure = std::string(status.message());
    log_->error("{}", summary_.failure);
    SaveSummary();
    return status;
  }
  SaveSummary();
  Say(absl::StrCat(
      "training ended (", Reason(summary_), "): ", WithCommas(summary_.games), " games, ",
      WithCommas(summary_.transitions), " transitions, ", WithCommas(summary_.updates), " updates in ",
      Clock(absl::Seconds(summary_.training_s)),
      saved ? "; all is saved" : absl::StrCat("; NOT all could be saved, see ", plan_.folder.log("launch"))));
  bool interrupted = summary_.ended == "interrupted";
  if (!interrupted) RETURN_IF_ERROR(FinalEvaluation(&interrupted));
  if (interrupted) {
    Say(absl::StrCat("no final table; it comes with: dbr evaluate --policy ", plan_.folder.root,
                     "\ncontinue with: dbr launch --resume --run-dir ", plan_.folder.root));
  }
  Say(absl::StrCat("run folder: ", plan_.folder.root));
  return interrupted ? kInterruptedExit : 0;
}

void Launch::Announce() {
  const LaunchConfig& limits = plan_.config.launch();
  std::vector<std::string> until;
  if (limits.max_seconds() > 0) until.push_back(Clock(absl::Seconds(limits.max_seconds())));
  if (limits.max_episodes() > 0) until.push_back(absl::StrCat(WithCommas(limits.max_episodes()), " games"));
  const std::uint64_t updates = plan_.config.learner().max_updates();
  if (updates > 0) until.push_back(absl::StrCat(WithCommas(updates), " updates"));
  Say(absl::StrCat(plan_.resume ? "continuing " : "training ", summary_.algorithm, " on ", summary_.env,
                   ", seed ", summary_.seed, ", ", plan_.actors, plan_.actors == 1 ? " actor" : " actors",
                   ", until ", until.empty() ? "it is stopped" : absl::StrJoin(until, " or "),
                   "; Ctrl-C stops and saves"));
  Say(absl::StrCat("run folder: ", plan_.folder.root));
}

absl::Status Launch::StartAll() {
  SupervisorOptions options = OptionsOf(plan_.config.launch());
  options.on_event = [this](const std::string& event, bool notable) {
    notable ? log_->warn("{}", event) : log_->info("{}", event);
    if (notable) line_.Say(event);
  };
  ASSIGN_OR_RETURN(supervisor_, Supervisor::Create(std::move(options)));
  supervisor_->set_restarting(false);
  for (ProcessSpec& process : Processes(plan_, programs_)) {
    const std::string name = process.name;
    RETURN_IF_ERROR(supervisor_->Start(std::move(process)));
    if (name == "replay") RETURN_IF_ERROR(WaitUntilServing(name, plan_.replay_address));
    if (name == "learner") RETURN_IF_ERROR(WaitUntilServing(name, plan_.learner_address));
    if (supervisor_->stop_signals() > 0) return absl::OkStatus();
  }
  supervisor_->set_restarting(true);
  monitor_ = std::make_unique<RunMonitor>(plan_.replay_address, plan_.learner_address, kAskEvery,
                                          [supervisor = supervisor_.get()] { supervisor->Wake(); });
  training_since_ = absl::Now();
  return absl::OkStatus();
}

// OK also where a stop signal came first.
absl::Status Launch::WaitUntilServing(const std::string& name, const std::string& address) {
  const HealthCheck check(address, kServingWithin, [supervisor = supervisor_.get()] { supervisor->Wake(); });
  while (supervisor_->stop_signals() == 0) {
    if (const std::optional<absl::Status> result = check.result()) {
      if (result->ok()) return absl::OkStatus();
      return absl::Status(result->code(),
                          absl::StrCat(name, " does not serve within ", absl::FormatDuration(kServingWithin),
                                       ": ", result->message(), "\n  its log: ", plan_.folder.log(name)));
    }
    RETURN_IF_ERROR(supervisor_->Wait(absl::InfiniteFuture()));
  }
  return absl::OkStatus();
}

absl::Status Launch::Train() {
  while (supervisor_->stop_signals() == 0) {
    const absl::Time now = absl::Now();
    Observe(now);
    if (LimitReached()) return absl::OkStatus();
    const std::uint32_t limit = plan_.config.launch().max_seconds();
    absl::Time deadline = absl::InfiniteFuture();  // the monitor wakes us
    if (limit > 0) deadline = now + absl::Seconds(limit - summary_.training_s);
    RETURN_IF_ERROR(supervisor_->Wait(deadline));
  }
  summary_.ended = "interrupted";
  return absl::OkStatus();
}

void Launch::Observe(absl::Time now) {
  const RunSample sample = monitor_->Latest();
  if (!first_.replay.has_value()) first_.replay = sample.replay;
  summary_.Update(sample);
  summary_.training_s = before_.training_s + absl::ToDoubleSeconds(now - training_since_);
  summary_.restarts = before_.restarts + supervisor_->restarts();
  const LaunchConfig& limits = plan_.config.launch();
  if (limits.max_seconds() > 0 && summary_.training_s >= limits.max_seconds()) {
    summary_.ended = "max_seconds";
  } else if (limits.max_episodes() > 0 && summary_.games >= limits.max_episodes()) {
    summary_.ended = "max_episodes";
  } else if (sample.learner.has_value() && sample.learner->finished()) {
    summary_.ended = "max_updates";
  }
  if (sample.replay.has_value()) line_.Update({sample, TimeLeft()}, now);
  if (now - summary_saved_ < kSummaryEvery) return;
  summary_saved_ = now;
  SaveSummary();
}

bool Launch::LimitReached() const {
  return summary_.ended != "running";
}

std::optional<absl::Duration> Launch::TimeLeft() const {
  const LaunchConfig& limits = plan_.config.launch();
  std::optional<absl::Duration> left;
  const auto within = [&left](double seconds) {
    if (!left.has_value() || absl::Seconds(seconds) < *left) left = absl::Seconds(seconds);
  };
  if (limits.max_seconds() > 0) within(limits.max_seconds() - summary_.training_s);
  const double here = summary_.training_s - before_.training_s;
  if (limits.max_episodes() > 0 && first_.replay.has_value() && summary_.games > first_.replay->episodes()) {
    const double games_per_second = static_cast<double>(summary_.games - first_.replay->episodes()) / here;
    within((static_cast<double>(limits.max_episodes()) - static_cast<double>(summary_.games)) /
           games_per_second);
  }
  const std::uint64_t updates = plan_.config.learner().max_updates();
  const RunSample sample = monitor_->Latest();
  if (updates > 0 && sample.learner.has_value() && sample.learner->updates_per_second() > 0) {
    within((static_cast<double>(updates) - static_cast<double>(summary_.updates)) /
           sample.learner->updates_per_second());
  }
  return left;
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
  const std::string table = ResultTable(summary_.final_results);
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
