// How each of our programs serves gRPC: health, reflection, insecure addresses refused, an address in use
// said.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace dbr {

struct ServerOptions {
  std::string address;          // "unix:/path/to.sock" or "host:port"; port 0 picks a free one
  bool allow_insecure = false;  // serve an address that other machines can reach, without authentication
};

// A running server; its address with the port that was picked.
struct RunningServer {
  std::unique_ptr<grpc::Server> server;
  std::string address;
};

// Starts a server with the standard health and reflection services beside `services` (not owned, alive until
// the server is gone). A stale unix socket that nobody serves is replaced. Errors: InvalidArgument for an
// address that other machines can reach without allow_insecure, or a socket path that is too long;
// AlreadyExists where it is in use.
absl::StatusOr<RunningServer> StartServer(const ServerOptions& options,
                                          const std::vector<grpc::Service*>& services);

}  // namespace dbr
