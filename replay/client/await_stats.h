// Waiting for the statistics of a replay server, for processes that cannot begin without them.
#pragma once

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/stop_flag.h"
#include "proto/replay.pb.h"
#include "replay/client/client.h"

namespace dbr {

// Asks once a second until the server answers, and logs once that it waits, with `purpose` ("to hear of its
// newest labels"). Blocks. Errors: Cancelled within a second after `stopping`, and those that no waiting
// mends (IsFinal): another program listens at the address, or one that speaks another protocol version.
absl::StatusOr<StatsReply> AwaitStats(ReplayClient* client, absl::string_view purpose,
                                      const StopFlag& stopping);

}  // namespace dbr
