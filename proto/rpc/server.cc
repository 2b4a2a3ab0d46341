#include "proto/rpc/server.h"

#include <arpa/inet.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <mutex>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/status_macros.h"
#include "proto/rpc/grpc_library.h"
#include "proto/rpc/keepalive.h"

namespace dbr {
namespace {

constexpr int kMaxMessageBytes = 256 << 20;

// "127.x.y.z:PORT", "[::1]:PORT" or "localhost:PORT"; a name that only begins like one of these may be
// anybody's.
bool IsLoopback(absl::string_view address) {
  const std::string host(address.substr(0, address.rfind(':')));
  in_addr parsed;
  if (inet_pton(AF_INET, host.c_str(), &parsed) == 1) return ntohl(parsed.s_addr) >> 24 == 127;
  return host == "localhost" || host == "[::1]";
}

// Tries to connect: true where somebody answers at the socket.
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

absl::Status CheckAddress(const ServerOptions& options) {
  const absl::string_view address = options.address;
  if (absl::StartsWith(address, "unix:")) {
    const std::string path(absl::StripPrefix(address, "unix:"));
    constexpr std::size_t kMaxPath = sizeof(sockaddr_un::sun_path) - 1;
    if (path.empty() || path.size() > kMaxPath) {
      return absl::InvalidArgumentError(absl::StrCat("socket path '", path, "': expected 1 to ", kMaxPath,
                                                     " characters, found ", path.size(),
                                                     ". Use a shorter run folder."));
    }
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
  if (address.find(':') == absl::string_view::npos) {
    return absl::InvalidArgumentError(
        absl::StrCat("address '", address, "': expected unix:PATH or HOST:PORT, for example 127.0.0.1:0"));
  }
  if (!IsLoopback(address) && !options.allow_insecure) {
    return absl::InvalidArgumentError(
        absl::StrCat("address '", address,
                     "' can be reached from other machines and there is no authentication yet: "
                     "use a unix socket or 127.0.0.1, or say --allow-insecure on a network that you trust."));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RunningServer> StartServer(const ServerOptions& options,
                                          const std::vector<grpc::Service*>& services) {
  RETURN_IF_ERROR(CheckAddress(options));
  KeepGrpcInitialized();
  static std::once_flag plugins;
  std::call_once(plugins, [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(options.address, grpc::InsecureServerCredentials(), &port);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveTimeMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  // How often a client may ask: more often than it does.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, kKeepaliveTimeMs / 2);
  builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
  for (grpc::Service* service : services) builder.RegisterService(service);
  RunningServer running;
  running.server = builder.BuildAndStart();
  if (running.server == nullptr || port == 0) return CannotListen(options.address);
  running.address = options.address;
  if (absl::EndsWith(options.address, ":0")) {
    running.address = absl::StrCat(absl::StripSuffix(options.address, "0"), port);
  }
  return running;
}

}  // namespace dbr
