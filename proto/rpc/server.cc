#include "proto/rpc/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <mutex>

#include "absl/cleanup/cleanup.h"
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

absl::Status AddressInUse(absl::string_view address) {
  return absl::AlreadyExistsError(
      absl::StrCat("cannot listen on ", address,
                   ": the address is in use. Stop the program that serves it or choose another address."));
}

// Tries what gRPC has failed at: the reason, or 0 where it works now or cannot be tried.
int WhyNotBound(const Address& address) {
  addrinfo hints = {};
  hints.ai_flags = AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(address.host.c_str(), absl::StrCat(address.port).c_str(), &hints, &found) != 0) return 0;
  const absl::Cleanup free_found = [found] { freeaddrinfo(found); };
  const int fd = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return errno;
  const int yes = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const int why = bind(fd, found->ai_addr, found->ai_addrlen) == 0 ? 0 : errno;
  close(fd);
  return why;
}

// gRPC does not say why it could not listen. What another start would find again has a code that says so
// (IsFinal).
absl::Status CannotListen(const Address& address, absl::string_view text) {
  const int why = address.is_unix() ? 0 : WhyNotBound(address);
  if (why == EADDRINUSE) return AddressInUse(text);
  const std::string message = absl::StrCat("cannot listen on ", text, ": ",
                                           why == 0 ? "the system refused it for now" : std::strerror(why));
  if (why == EADDRNOTAVAIL || why == EACCES) {
    return absl::InvalidArgumentError(absl::StrCat(
        message, ". Choose an address of this machine that this user may open, or a unix socket."));
  }
  return absl::UnavailableError(message);
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
  if (running.server == nullptr || port == 0) return CannotListen(address, options.address);
  running.address = options.address;
  if (!address.is_unix() && address.port == 0) {
    running.address = absl::StrCat(options.address.substr(0, options.address.rfind(':') + 1), port);
  }
  return running;
}

}  // namespace dbr
