// The replay server's figures in the run's metrics.
#pragma once

#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "learner/metrics/metrics_sink.h"
#include "replay/client/client.h"

namespace dbr {

// Asks for the statistics every `period` in a thread of its own and writes a row of metrics for each answer,
// whose step is the number of inserted transitions. A question without an answer is passed over.
class RolloutReporter {
 public:
  // `client` and `metrics` outlive the reporter, which closes the client.
  RolloutReporter(ReplayClient* client, MetricsSink* metrics, absl::Duration period);
  ~RolloutReporter();  // ends a question under way and joins

 private:
  void Run();
  void Report(const StatsReply& stats);

  ReplayClient* const client_;
  MetricsSink* const metrics_;
  const absl::Duration period_;
  absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace dbr
