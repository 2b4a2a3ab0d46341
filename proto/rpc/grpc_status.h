// The only mapping between our errors and gRPC's.
#pragma once

#include <grpcpp/support/status.h>

#include "absl/status/status.h"

namespace dbr {

grpc::Status ToGrpc(const absl::Status& status);
// gRPC says nothing of a server that lacks the service; here it says what that means.
absl::Status FromGrpc(const grpc::Status& status);

// Whether `status`, of a call, is an error that another try cannot mend.
bool IsFinal(const absl::Status& status);

}  // namespace dbr
