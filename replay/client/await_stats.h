// The replay server's statistics, for a process that cannot begin without them.
#pragma once

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/synchronization/notification.h"
#include "proto/replay.pb.h"
#include "replay/client/client.h"

namespace dbr {

// Asks until the server answers, and logs once, with `purpose`, that it waits. Cancelled after `stopping`,
// within a second; an error of a server that will never answer (IsFinal), as one that is another program.
absl::StatusOr<StatsReply> AwaitStats(ReplayClient* client, absl::string_view purpose,
                                      const absl::Notification& stopping);

}  // namespace dbr
