// The actor and the evaluator: the two programs of this folder, without their flags.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "actor/best_policy.h"
#include "actor/evaluation_loop.h"
#include "actor/policy_subscriber.h"
#include "actor/step_loop.h"
#include "core/stop_flag.h"
#include "envs/env.h"
#include "proto/config.pb.h"
#include "proto/policy.pb.h"
#include "proto/rpc/learner_client.h"
#include "replay/client/writer.h"

namespace dbr {

struct ActorOptions {
  Config config;
  int index = 0;      // the actor process's number, from 0
  int processes = 0;  // the run's actor processes; 0: the config's number, or 1 where it has none
  std::string replay_address;
  std::string learner_address;
  bool resumed = false;          // for the evaluator: an earlier one ran in this run
  std::string best_policy = {};  // the file for the evaluator's best policy; empty: none is kept
  absl::Duration drain_timeout = absl::Seconds(5);  // the wait at the end for acknowledgements
};

// Steps its environments by the newest policy and writes the transitions to the replay server. Without a
// learner it continues with the last policy. Without a replay server it waits once the writer's buffer is
// full. Owns its environments, its subscriber and its writer. One thread calls Run; Stop is thread-safe.
class Actor {
 public:
  // Returns the errors of MakeEnv. Connects in the background, so the servers need not run yet.
  static absl::StatusOr<std::unique_ptr<Actor>> Create(const ActorOptions& options);

  // Blocks until Stop(), and then returns OK, or until a final error of the policy, the environments or the
  // writer. In both cases it then blocks until everything that was written is acknowledged, or until
  // drain_timeout has passed, and logs the counts. Where algorithm.n_step is above 1, Stop() sends the last
  // steps of unfinished episodes as transitions of fewer steps. They are dropped where the replay server
  // takes no more, and after an error.
  absl::Status Run();

  void Stop();  // from any thread

  WriterCounters counters() const { return writer_->counters(); }

 private:
  Actor(const ActorOptions& options, std::unique_ptr<VectorEnv> envs);

  absl::Status Act();
  absl::StatusOr<ExplorationOptions> Exploring() const;
  absl::Status Write(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                     const std::optional<EpisodeEnd>& end);
  void Drain();

  const ActorOptions options_;
  std::unique_ptr<VectorEnv> envs_;  // until the step loop takes them
  std::unique_ptr<PolicySubscriber> subscriber_;
  std::unique_ptr<TransitionWriter> writer_;
  StopFlag stopping_;
};

// Evaluates the newest policy again and again and reports to the learner. One thread calls Run; Stop is
// thread-safe.
class EvaluatorProcess {
 public:
  // Returns the errors of MakeEnv for any opponent.
  static absl::StatusOr<std::unique_ptr<EvaluatorProcess>> Create(const ActorOptions& options);

  absl::Status Run();  // blocks until Stop(), and then returns OK, or until a final error
  void Stop();         // from any thread

 private:
  EvaluatorProcess(const ActorOptions& options, const EnvSpec& env);

  absl::Status Report(const EvaluationReport& report);

  BestPolicy best_;
  LearnerClient learner_;
  PolicySubscriber subscriber_;
  EvaluationLoop loop_;
};

}  // namespace dbr
