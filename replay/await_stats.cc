#include "replay/await_stats.h"

#include <spdlog/spdlog.h>

#include <string>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace dbr {
namespace {

constexpr absl::Duration kAskEvery = absl::Seconds(1);

}  // namespace

absl::StatusOr<StatsReply> AwaitStats(ReplayClient* client, absl::string_view purpose,
                                      const std::atomic<bool>& stopping) {
  for (bool first = true; !stopping; first = false) {
    const absl::Time asked = absl::Now();
    absl::StatusOr<StatsReply> stats = client->Stats(kAskEvery);
    const bool will_answer = absl::IsUnavailable(stats.status()) || absl::IsDeadlineExceeded(stats.status());
    if (stats.ok() || !will_answer) return stats;
    if (first)
      spdlog::info("waiting for the replay server, {}: {}", std::string(purpose),
                   std::string(stats.status().message()));
    absl::SleepFor(asked + kAskEvery - absl::Now());
  }
  return absl::CancelledError("stopped while the replay server did not answer");
}

}  // namespace dbr
