// What the services say about a run, asked again and again.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "deploy/launch/evaluation_feed.h"
#include "proto/policy.pb.h"
#include "proto/replay.pb.h"
#include "proto/rpc/learner_client.h"
#include "replay/client/client.h"

namespace dbr {

// The newest answers of the services; an answer stays while its service is away. A sample has each report of
// an evaluator that no sample before had, however many rounds of questions lie between them.
struct RunSample {
  std::optional<StatsReply> replay;
  std::optional<LearnerStatus> learner;
  std::vector<EvaluationReport> reports;  // in order
  std::uint64_t missed_reports = 0;       // in this launch, that the learner dropped before it was asked
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

  // A sample of the newest answers. Asks nobody.
  RunSample Take();

  // Take() after one more round now, in the calling thread; blocks for at most `timeout` for each service.
  RunSample Ask(absl::Duration timeout);

 private:
  void Run();
  absl::Status AskBoth(absl::Duration timeout) ABSL_LOCKS_EXCLUDED(mutex_);  // the refusal

  const std::string replay_address_;
  const std::string learner_address_;
  ReplayClient replay_;
  LearnerClient learner_;
  const absl::Duration period_;
  const std::function<void()> on_sample_;
  absl::Mutex mutex_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  RunSample latest_ ABSL_GUARDED_BY(mutex_);  // without the reports
  EvaluationFeed feed_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace dbr
