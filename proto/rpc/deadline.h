// The deadlines of calls, by the monotonic clock: setting the time of day moves none of them.
#pragma once

#include <grpcpp/grpcpp.h>

#include "absl/time/time.h"

namespace dbr {

// `timeout` from now, as gRPC takes it in place of a std::chrono time.
gpr_timespec DeadlineAfter(absl::Duration timeout);

// Sets the deadline of a call to `timeout` from now.
void SetDeadline(absl::Duration timeout, grpc::ClientContext* context);

// The caller's deadline on the clock of MonotonicNow() (core/monotonic_clock.h); InfiniteFuture without one.
absl::Time DeadlineOf(const grpc::ServerContext& context);

}  // namespace dbr
