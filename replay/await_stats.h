// The replay server's statistics, for a process that cannot begin without them.
#pragma once

#include <atomic>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "proto/replay.pb.h"
#include "replay/client.h"

namespace dbr {

// Asks until the server answers, and logs once, with `purpose`, that it waits. Cancelled once `stopping` is
// set; an error of a server that will never answer, as one that is another program.
absl::StatusOr<StatsReply> AwaitStats(ReplayClient* client, absl::string_view purpose,
                                      const std::atomic<bool>& stopping);

}  // namespace dbr
