#include "learner/runtime/rollout_reporter.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <string>

#include "absl/time/clock.h"
#include "core/monotonic_clock.h"

namespace dbr {

RolloutReporter::RolloutReporter(ReplayClient* client, MetricsSink* metrics, absl::Duration period)
    : client_(client), metrics_(metrics), period_(period), thread_([this] { Run(); }) {}

RolloutReporter::~RolloutReporter() {
  {
    absl::MutexLock lock(&mutex_);
    closed_ = true;
  }
  client_->Close();
  thread_.join();
}

void RolloutReporter::Run() {
  for (;;) {
    {
      absl::MutexLock lock(&mutex_);
      if (AwaitFor(&mutex_, absl::Condition(&closed_), period_)) return;
    }
    if (const absl::StatusOr<StatsReply> stats = client_->Stats(absl::Seconds(2)); stats.ok()) Report(*stats);
  }
}

void RolloutReporter::Report(const StatsReply& stats) {
  Scalars scalars = {{tags::kTransitions, static_cast<double>(stats.inserted())},
                     {tags::kEpisodes, static_cast<double>(stats.episodes())},
                     {tags::kTransitionsPerSecond, stats.insert_rate()},
                     {"replay/total", static_cast<double>(stats.total())},
                     {"replay/plus", static_cast<double>(stats.plus())},
                     {"replay/minus", static_cast<double>(stats.minus())},
                     {"replay/unjudged", static_cast<double>(stats.unjudged())},
                     {"replay/samples_per_insert", stats.samples_per_insert()},
                     {"replay/label_age_mean", stats.label_age_mean()}};
  if (stats.seed_buffer_rows() > 0) {
    scalars.emplace_back("replay/seed_buffer", static_cast<double>(stats.seed_buffer()));
    scalars.emplace_back("replay/seed_buffer_plus", static_cast<double>(stats.seed_buffer_plus()));
    scalars.emplace_back("replay/seed_buffer_minus", static_cast<double>(stats.seed_buffer_minus()));
  }
  if (stats.episodes() > 0) {
    scalars.emplace_back(tags::kEpisodeReturn, stats.recent_return_mean());
    scalars.emplace_back(tags::kEpisodeLength, stats.recent_length_mean());
    if (std::isfinite(stats.recent_score_mean()))
      scalars.emplace_back(tags::kEpisodeScore, stats.recent_score_mean());
  }
  const absl::Status status =
      metrics_->Write(static_cast<std::int64_t>(stats.inserted()), absl::Now(), scalars);
  if (!status.ok()) spdlog::error("metrics: {}", std::string(status.message()));
}

}  // namespace dbr
