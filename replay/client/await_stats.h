// Waiting for the statistics of a replay server, for processes that cannot begin without them.
#pragma once

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/synchronization/notification.h"
#include "proto/replay.pb.h"
#include "replay/client/client.h"

namespace dbr {

// Asks until the server answers. Blocks; logs once, with `purpose`, that it waits. Errors: Cancelled, within
// a second of `stopping`; the server's error where it is final (IsFinal), as from a server of another
// program.
absl::StatusOr<StatsReply> AwaitStats(ReplayClient* client, absl::string_view purpose,
                                      const absl::Notification& stopping);

}  // namespace dbr
