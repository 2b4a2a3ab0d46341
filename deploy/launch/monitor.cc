#include "deploy/launch/monitor.h"

#include <utility>

namespace dbr {
namespace {

constexpr absl::Duration kCallTimeout = absl::Seconds(2);

}  // namespace

RunMonitor::RunMonitor(const std::string& replay_address, const std::string& learner_address,
                       absl::Duration period, std::function<void()> on_sample)
    : replay_(replay_address),
      learner_(learner_address),
      period_(period),
      on_sample_(std::move(on_sample)),
      thread_([this] { Run(); }) {}

RunMonitor::~RunMonitor() {
  {
    absl::MutexLock lock(&mutex_);
    stopping_ = true;
  }
  replay_.Close();
  thread_.join();
}

RunSample RunMonitor::Latest() const {
  absl::MutexLock lock(&mutex_);
  return latest_;
}

RunSample RunMonitor::Ask(absl::Duration timeout) {
  const absl::StatusOr<StatsReply> stats = replay_.Stats(timeout);
  const absl::StatusOr<LearnerStatus> status = learner_.Status(timeout);
  absl::MutexLock lock(&mutex_);
  latest_.replay_away = !stats.ok();
  if (stats.ok()) latest_.replay = *stats;
  latest_.learner_away = !status.ok();
  if (status.ok()) latest_.learner = *status;
  return latest_;
}

void RunMonitor::Run() {
  for (;;) {
    Ask(kCallTimeout);
    on_sample_();
    absl::MutexLock lock(&mutex_);
    if (mutex_.AwaitWithTimeout(absl::Condition(&stopping_), period_)) return;
  }
}

}  // namespace dbr
