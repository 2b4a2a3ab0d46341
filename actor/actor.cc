#include "actor/actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/rng.h"
#include "core/status_macros.h"
#include "envs/registry/registry.h"
#include "proto/config/config_file.h"
#include "replay/client/await_stats.h"
#include "replay/client/client.h"

namespace dbr {
namespace {

constexpr std::uint64_t kActorStream = 1 << 20;      // stream of the seed; plus the actor's index
constexpr std::uint64_t kEvaluatorStream = 1 << 19;  // stream of the seed
constexpr std::size_t kBufferedSteps = 16;           // for each environment, where the config says 0
constexpr absl::Duration kStopCheck = absl::Milliseconds(100);
constexpr absl::Duration kReportTimeout = absl::Seconds(5);

Rng ActorRng(const ActorOptions& options) {
  return Rng(options.config.seed()).Fork(kActorStream + options.index);
}

SubscriberOptions Subscription(const ActorOptions& options, const EnvSpec& env, std::string name,
                               std::uint64_t seed) {
  return {.address = options.learner_address,
          .name = std::move(name),
          .expected = ExpectedPolicy(env, options.config),
          .seed = seed};
}

WriterOptions Writing(const ActorOptions& options, const EnvSpec& env) {
  const ActorConfig& actor = options.config.actor();
  WriterOptions writing;
  writing.address = options.replay_address;
  writing.name = absl::StrCat("actor-", options.index);
  writing.layout = TransitionLayout::Of(env, OptionalColumnsOf(options.config.algorithm()));
  writing.batch_bytes = actor.batch_bytes();
  writing.window = static_cast<int>(actor.window());
  writing.buffered_transitions =
      actor.buffered_transitions() > 0 ? actor.buffered_transitions() : kBufferedSteps * actor.envs();
  return writing;
}

EvaluationLoopOptions Evaluating(const ActorOptions& options, const std::string& env) {
  const EvaluationConfig& evaluation = options.config.evaluation();
  return {
      .opponents = OpponentsToEvaluate(env, {evaluation.opponents().begin(), evaluation.opponents().end()}),
      .episodes = static_cast<int>(evaluation.episodes()),
      .seed = Rng(options.config.seed()).Fork(kEvaluatorStream)() >> 32,
      .mode = evaluation.mode(),
      .which = evaluation.which(),
      .threads = 1,
      .every = absl::Seconds(evaluation.every_s()),
      .every_updates = evaluation.every_updates(),
      .resumed = options.resumed};
}

// Logs the number of episodes whose world failed: at the first one, and each time the number has doubled.
class BrokenWorlds {
 public:
  void Tell(const StepCounters& counters) {
    if (counters.broken < next_) return;
    spdlog::warn("in {} of {} episodes the simulation gave values that are not finite; they were cut there",
                 counters.broken, counters.episodes);
    next_ = 2 * counters.broken;
  }

 private:
  std::uint64_t next_ = 1;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Actor>> Actor::Create(const ActorOptions& options) {
  ASSIGN_OR_RETURN(
      std::unique_ptr<VectorEnv> envs,
      VectorEnv::Create(TrainingEnv(options.config.env()), static_cast<int>(options.config.actor().envs())));
  RETURN_IF_ERROR(CheckExploration(envs->spec(), options.config.actor()));
  return std::unique_ptr<Actor>(new Actor(options, std::move(envs)));
}

Actor::Actor(const ActorOptions& options, std::unique_ptr<VectorEnv> envs)
    : options_(options),
      envs_(std::move(envs)),
      subscriber_(std::make_unique<PolicySubscriber>(
          Subscription(options, envs_->spec(), absl::StrCat("actor-", options.index), ActorRng(options)()))),
      writer_(std::make_unique<TransitionWriter>(Writing(options, envs_->spec()))) {}

void Actor::Stop() {
  stopping_.Set();
  subscriber_->Close();
}

absl::Status Actor::Run() {
  const absl::Status status = Act();
  Drain();
  return stopping_.IsSet() ? absl::OkStatus() : status;
}

absl::Status Actor::Act() {
  ASSIGN_OR_RETURN(const PolicySubscriber::PolicyPtr first,
                   subscriber_->WaitForFirst(absl::InfiniteDuration()));
  spdlog::info("acting in {} environments, from policy version {}", envs_->size(), first->snapshot().version);
  ASSIGN_OR_RETURN(const ExplorationOptions exploring, Exploring());
  const ActorConfig& actor = options_.config.actor();
  const StepLoopOptions stepping = {.mode = actor.mode(),
                                    .exploration = exploring,
                                    .discount = options_.config.algorithm().discount(),
                                    .columns = OptionalColumnsOf(options_.config.algorithm()),
                                    .reward_scale = options_.config.algorithm().reward_scale(),
                                    .n_step = static_cast<int>(options_.config.algorithm().n_step())};
  // An actor that restarts in the middle of a run must not repeat its first games.
  const Rng rng = ActorRng(options_).Fork(first->snapshot().version);
  StepLoop loop(std::move(envs_), stepping, rng,
                [this](const TransitionView& transition, float advantage, std::uint64_t critic_version,
                       const std::optional<EpisodeEnd>& end) {
                  return Write(transition, advantage, critic_version, end);
                });
  BrokenWorlds worlds;
  while (!stopping_.IsSet()) {
    const absl::StatusOr<PolicySubscriber::PolicyPtr> policy = subscriber_->Current();
    if (stopping_.IsSet()) break;  // which closes the subscriber
    RETURN_IF_ERROR(policy.status());
    RETURN_IF_ERROR(loop.Step(**policy));
    worlds.Tell(loop.counters());
  }
  RETURN_IF_ERROR(loop.Flush());
  if (loop.held_back() > 0) {
    spdlog::info("{} transitions of episodes that had not ended are dropped, for their returns are not known",
                 loop.held_back());
  }
  return absl::OkStatus();
}

// Where epsilon decays, the replay server knows how far the run has come. An actor that restarts, or starts
// in a resumed run, continues from there.
absl::StatusOr<ExplorationOptions> Actor::Exploring() const {
  const ActorConfig& actor = options_.config.actor();
  ExplorationOptions exploring = ExplorationOptions::Of(actor);
  const int processes = options_.processes > 0 ? options_.processes : static_cast<int>(actor.processes());
  exploring.processes = std::max(1, processes);
  if (exploring.epsilon_decay_steps == 0) return exploring;
  ReplayClient replay(options_.replay_address);
  ASSIGN_OR_RETURN(const StatsReply stats,
                   AwaitStats(&replay, "to hear how many steps the run has made", stopping_));
  exploring.first_step = stats.inserted();
  return exploring;
}

absl::Status Actor::Write(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                          const std::optional<EpisodeEnd>& end) {
  for (;;) {
    const absl::Status status = writer_->Append(transition, advantage, critic_version, end, kStopCheck);
    if (!absl::IsDeadlineExceeded(status)) return status;
    if (stopping_.IsSet()) return absl::CancelledError("stopped while the replay server took no transitions");
  }
}

void Actor::Drain() {
  const absl::Status status = writer_->Flush(options_.drain_timeout);
  const WriterCounters counters = writer_->counters();
  writer_->Close();
  if (status.ok()) {
    spdlog::info("stopped; all {} transitions are with the replay server", counters.acknowledged);
    return;
  }
  spdlog::warn("stopped; the replay server acknowledged {} of {} transitions: {}", counters.acknowledged,
               counters.appended, std::string(status.message()));
}

absl::StatusOr<std::unique_ptr<EvaluatorProcess>> EvaluatorProcess::Create(const ActorOptions& options) {
  EnvOptions env_options{.name = options.config.env().name(), .opponents = {}};
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv(env_options));
  for (const std::string& opponent : options.config.evaluation().opponents()) {
    env_options.opponents = {opponent};
    RETURN_IF_ERROR(MakeEnv(env_options).status());
  }
  return std::unique_ptr<EvaluatorProcess>(new EvaluatorProcess(options, env->spec()));
}

EvaluatorProcess::EvaluatorProcess(const ActorOptions& options, const EnvSpec& env)
    : best_(options.best_policy, MeasureOf(env.name, Evaluating(options, env.name))),
      learner_(options.learner_address),
      subscriber_(
          Subscription(options, env, "evaluator", Rng(options.config.seed()).Fork(kEvaluatorStream)())),
      loop_(
          Evaluating(options, env.name),
          {.newest_policy = [this] { return subscriber_.Current(); },
           .report = [this](const EvaluationReport& report) { return Report(report); },
           .next_policy = [this](const PolicySubscriber::PolicyPtr& last,
                                 absl::Duration timeout) { return subscriber_.WaitForOther(last, timeout); },
           .on_mean = [this](double mean, PolicyChoice played,
                             const PolicySnapshot& snapshot) { best_.Offer(mean, played, snapshot); }}) {}

absl::Status EvaluatorProcess::Run() {
  return loop_.Run();
}

void EvaluatorProcess::Stop() {
  loop_.Close();
  subscriber_.Close();
}

absl::Status EvaluatorProcess::Report(const EvaluationReport& report) {
  return learner_.ReportEvaluation(report, kReportTimeout);
}

}  // namespace dbr
