// The two programs of this room without their flags: the actor and the evaluator.
#pragma once

#include <memory>
#include <string>

#include "absl/base/call_once.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/notification.h"
#include "absl/time/time.h"
#include "actor/evaluation_loop.h"
#include "actor/policy_subscriber.h"
#include "actor/step_loop.h"
#include "envs/env.h"
#include "proto/config.pb.h"
#include "proto/policy.pb.h"
#include "proto/rpc/learner_client.h"
#include "replay/client/writer.h"

namespace dbr {

struct ActorOptions {
  Config config;
  int index = 0;      // of the actor process
  int processes = 0;  // actors of the run; 0: as many as the config says, or one where it leaves that open
  std::string replay_address;
  std::string learner_address;
  bool resumed = false;          // the evaluator: another one was there before, in this run
  std::string best_policy = {};  // file for the evaluator's best policy; empty: none is kept
  absl::Duration drain_timeout = absl::Seconds(5);  // for what is still unacknowledged at the end
};

// Steps its environments by the newest policy and writes the transitions to the replay server. Without a
// learner it goes on with the last policy; without a replay server it waits once the writer's buffer is full.
class Actor {
 public:
  // Errors as MakeEnv's. Connects in the background: the servers need not be there yet.
  static absl::StatusOr<std::unique_ptr<Actor>> Create(const ActorOptions& options);

  // Blocks until Stop(), which gives OK, or until a final error of the policy, the environments or the
  // writer; then, in either case, until all that was written is acknowledged or drain_timeout has passed
  // (which is said, with the counts).
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
  absl::once_flag stop_once_;
  absl::Notification stopping_;
};

// Evaluates the newest policy now and then and reports to the learner.
class EvaluatorProcess {
 public:
  // Errors as MakeEnv's, for each opponent.
  static absl::StatusOr<std::unique_ptr<EvaluatorProcess>> Create(const ActorOptions& options);

  absl::Status Run();  // until Stop(), which gives OK, or a final error
  void Stop();         // from any thread

 private:
  EvaluatorProcess(const ActorOptions& options, const EnvSpec& env);

  absl::Status Report(const EvaluationReport& report);
  void KeepBest(const PolicySnapshot& snapshot) const;

  const std::string best_policy_;
  LearnerClient learner_;
  PolicySubscriber subscriber_;
  EvaluationLoop loop_;
};

}  // namespace dbr
