// How each of our clients connects.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "absl/time/time.h"

namespace dbr {

// A channel of its own connection to "unix:/path" or "host:port"; reconnects by itself within a second of the
// server's return.
std::shared_ptr<grpc::Channel> MakeChannel(const std::string& address);

// Sets the deadline of a call.
void SetDeadline(absl::Duration timeout, grpc::ClientContext* context);

}  // namespace dbr
