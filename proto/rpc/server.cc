#include "proto/rpc/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <mutex>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/status_macros.h"
#include "proto/rpc/address.h"
#include "proto/rpc/grpc_library.h"
#include "proto/rpc/keepalive.h"

namespace dbr {
namespace {

constexpr int kMaxMessageBytes = 256 << 20;

// Tries to connect: true where somebody answers at the socket, whose path is at most 107 bytes long.
bool SocketIsServed(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const bool served = connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  close(fd);
  return served;
}

// gRPC does not say why it could not listen.
absl::Status CannotListen(absl::string_view address) {
  return absl::AlreadyExistsError(
      absl::StrCat("cannot listen on ", address,
                   ": the address is in use, or is none that this user may open on this machine. Stop the "
                   "program that serves it or choose another address."));
}

absl::Status AddressInUse(absl::string_view address) {
  return absl::AlreadyExistsError(
      absl::StrCat("cannot listen on ", address,
                   ": the address is in use. Stop the program that serves it or choose another address."));
}

// Removes a socket that a killed server left at `path`, the reachable one of `address`.
absl::Status MakeRoom(const std::string& path, absl::string_view address) {
  struct stat found;
  if (lstat(path.c_str(), &found) != 0) return absl::OkStatus();
  if (!S_ISSOCK(found.st_mode)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "cannot listen on ", address, ": expected a socket or nothing at that path, found another file"));
  }
  if (SocketIsServed(path)) return AddressInUse(address);
  unlink(path.c_str());
  return absl::OkStatus();
}

std::string TcpAddress(const Address& address) {
  const bool v6 = absl::StrContains(address.host, ':');
  // gRPC decodes what it listens on, and an IPv6 address may have a '%' before its interface.
  const std::string host =
      v6 ? absl::StrCat("[", absl::StrReplaceAll(address.host, {{"%", "%25"}}), "]") : address.host;
  return absl::StrCat(host, ":", address.port);
}

}  // namespace

absl::StatusOr<RunningServer> StartServer(const ServerOptions& options,
                                          const std::vector<grpc::Service*>& services) {
  RETURN_IF_ERROR(CheckServerAddress(options.address, options.allow_insecure));
  ASSIGN_OR_RETURN(const Address address, ParseAddress(options.address));
  RunningServer running;
  if (address.is_unix()) {
    ASSIGN_OR_RETURN(running.socket, SocketPath::Open(address.path));
    RETURN_IF_ERROR(MakeRoom(running.socket->reachable(), options.address));
  }
  KeepGrpcInitialized();
  static std::once_flag plugins;
  std::call_once(plugins, [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(address.is_unix() ? running.socket->GrpcAddress() : TcpAddress(address),
                           grpc::InsecureServerCredentials(), &port);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveTimeMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  // How often a client may ask: more often than it does.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, kKeepaliveTimeMs / 2);
  builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
  for (grpc::Service* service : services) builder.RegisterService(service);
  running.server = builder.BuildAndStart();
  if (running.server == nullptr || port == 0) return CannotListen(options.address);
  running.address = options.address;
  if (!address.is_unix() && address.port == 0) {
    running.address = absl::StrCat(options.address.substr(0, options.address.rfind(':') + 1), port);
  }
  return running;
}

}  // namespace dbr
