// What the services say about a run, asked again and again.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "proto/policy.pb.h"
#include "proto/replay.pb.h"
#include "proto/rpc/learner_client.h"
#include "replay/client/client.h"

namespace dbr {

// The newest answers of the services; an answer stays while its service is away.
struct RunSample {
  std::optional<StatsReply> replay;
  std::optional<LearnerStatus> learner;
  bool replay_away = false;
  bool learner_away = false;
  // OK, or the error of a service for which no other question will be answered (IsFinal,
  // proto/rpc/grpc_status.h): it speaks another protocol version, for example.
  absl::Status refusal;
};

// Asks both services every `period` in a thread of its own, until there is a refusal. Thread-safe.
class RunMonitor {
 public:
  // `on_sample` is called from the monitor's thread after each round; it must not block.
  RunMonitor(const std::string& replay_address, const std::string& learner_address, absl::Duration period,
             std::function<void()> on_sample);
  ~RunMonitor();  // joins; blocks for one round's timeout at most
  RunMonitor(const RunMonitor&) = delete;
  RunMonitor& operator=(const RunMonitor&) = delete;

  RunSample Latest() const;

  // One more round now, in the calling thread; blocks for at most `timeout` for each service.
  RunSample Ask(absl::Duration timeout);

 private:
  void Run();

  const std::string replay_address_;
  const std::string learner_address_;
  ReplayClient replay_;
  LearnerClient learner_;
  const absl::Duration period_;
  const std::function<void()> on_sample_;
  mutable absl::Mutex mutex_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  RunSample latest_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace dbr
