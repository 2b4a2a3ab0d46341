// How each of our programs serves gRPC.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "proto/rpc/socket_path.h"

namespace dbr {

struct ServerOptions {
  std::string address;          // as proto/rpc/address.h reads it; port 0 picks a free one
  bool allow_insecure = false;  // serve an address that other machines can reach, without authentication
};

// A running server. The owner shuts it down before the services that it was started with are gone.
struct RunningServer {
  std::shared_ptr<const SocketPath> socket;  // or null; the server removes its socket by it when it ends
  std::unique_ptr<grpc::Server> server;
  std::string address;  // as in the options, with the port that was picked
};

// Starts a server with the standard health and reflection services beside `services` (not owned, alive until
// the server is gone). Messages of up to 256 MiB are taken. A stale unix socket that nobody serves is
// replaced; another file at its path is left alone. Errors: InvalidArgument for an address that is none, one
// that other machines can reach without allow_insecure, a socket whose name is too long or where another file
// lies; NotFound or PermissionDenied for a folder that cannot be opened; AlreadyExists where the address is
// in use or cannot be opened.
absl::StatusOr<RunningServer> StartServer(const ServerOptions& options,
                                          const std::vector<grpc::Service*>& services);

}  // namespace dbr
