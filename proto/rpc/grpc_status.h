// The only mapping between our errors and gRPC's, and the only rule for which of them are final.
#pragma once

#include <grpcpp/support/status.h>

#include "absl/status/status.h"

namespace dbr {

// The same code and message, as gRPC's type.
grpc::Status ToGrpc(const absl::Status& status);

// The same code and message, as our type. gRPC sends UNIMPLEMENTED without a message where the server lacks
// the service; the message here then says that another program may listen at the address.
absl::Status FromGrpc(const grpc::Status& status);

// Whether `status`, the result of a call or a stream, is an error that another try cannot mend. True for what
// is wrong with the request or with who asks: InvalidArgument, OutOfRange, NotFound, AlreadyExists,
// FailedPrecondition (another protocol version), Unimplemented (another program), PermissionDenied and
// Unauthenticated. False for OK and for what may pass: a server that is away, stopping or full, a limit of
// time, a message that was damaged on its way. Whoever retries waits between two tries.
bool IsFinal(const absl::Status& status);

}  // namespace dbr
