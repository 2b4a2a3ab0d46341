#include "deploy/launch/monitor.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/monotonic_clock.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {
namespace {

constexpr absl::Duration kCallTimeout = absl::Seconds(2);

// Takes note of an error that is final; the first one stays.
void NoteRefusal(const std::string& address, const absl::Status& status, absl::Status* refusal) {
  if (!IsFinal(status)) return;
  refusal->Update(absl::Status(status.code(), absl::StrCat(address, ": ", status.message())));
}

}  // namespace

RunMonitor::RunMonitor(const std::string& replay_address, const std::string& learner_address,
                       absl::Duration period, std::function<void()> on_sample)
    : replay_address_(replay_address),
      learner_address_(learner_address),
      replay_(replay_address),
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

RunSample RunMonitor::Take() {
  absl::MutexLock lock(&mutex_);
  RunSample sample = latest_;
  sample.reports = feed_.Take();
  sample.missed_reports = feed_.missed();
  return sample;
}

RunSample RunMonitor::Ask(absl::Duration timeout) {
  AskBoth(timeout).IgnoreError();  // the sample holds it
  return Take();
}

absl::Status RunMonitor::AskBoth(absl::Duration timeout) {
  LearnerStatusRequest have;
  {
    absl::MutexLock lock(&mutex_);
    have = feed_.have();
  }
  const absl::StatusOr<StatsReply> stats = replay_.Stats(timeout);
  absl::StatusOr<LearnerStatus> status = learner_.Status(timeout, have);
  absl::MutexLock lock(&mutex_);
  NoteRefusal(replay_address_, stats.status(), &latest_.refusal);
  NoteRefusal(learner_address_, status.status(), &latest_.refusal);
  latest_.replay_away = !stats.ok();
  if (stats.ok()) latest_.replay = *stats;
  latest_.learner_away = !status.ok();
  if (status.ok()) {
    feed_.Read(*status);
    status->clear_reports();
    latest_.learner = *std::move(status);
  }
  return latest_.refusal;
}

void RunMonitor::Run() {
  for (;;) {
    const bool refused = !AskBoth(kCallTimeout).ok();
    on_sample_();
    if (refused) return;
    absl::MutexLock lock(&mutex_);
    if (AwaitFor(&mutex_, absl::Condition(&stopping_), period_)) return;
  }
}

}  // namespace dbr
