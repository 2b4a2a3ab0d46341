#include "replay/client/await_stats.h"

#include <spdlog/spdlog.h>

#include <string>

#include "absl/time/time.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {
namespace {

constexpr absl::Duration kAskEvery = absl::Seconds(1);

}  // namespace

absl::StatusOr<StatsReply> AwaitStats(ReplayClient* client, absl::string_view purpose,
                                      const StopFlag& stopping) {
  for (bool first = true; !stopping.IsSet(); first = false) {
    absl::StatusOr<StatsReply> stats = client->Stats(kAskEvery);
    if (stats.ok() || IsFinal(stats.status())) return stats;
    if (first)
      spdlog::info("waiting for the replay server, {}: {}", std::string(purpose),
                   std::string(stats.status().message()));
    stopping.WaitFor(kAskEvery);
  }
  return absl::CancelledError("stopped while the replay server did not answer");
}

}  // namespace dbr
