#include "proto/rpc/channel.h"

#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "proto/rpc/address.h"
#include "proto/rpc/grpc_library.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/keepalive.h"
#include "proto/rpc/socket_path.h"

namespace dbr {
namespace {

// What gRPC connects to, and the socket's folder where there is one.
struct Target {
  std::string name;
  std::shared_ptr<const SocketPath> socket;
};

absl::StatusOr<Target> FindTarget(const std::string& text) {
  ASSIGN_OR_RETURN(const Address address, ParseClientAddress(text));
  if (address.is_unix()) {
    ASSIGN_OR_RETURN(std::shared_ptr<const SocketPath> socket, SocketPath::Open(address.path));
    std::string name = socket->GrpcAddress();
    return Target{std::move(name), std::move(socket)};
  }
  const bool v6 = absl::StrContains(address.host, ':');
  const std::string host = v6 ? absl::StrCat("[", address.host, "]") : address.host;
  return Target{absl::StrCat("dns:///", PercentEncode(absl::StrCat(host, ":", address.port))), nullptr};
}

grpc::ChannelArguments Arguments() {
  grpc::ChannelArguments arguments;
  // The variables http_proxy, https_proxy and grpc_proxy are for the web: no proxy knows our services, and
  // one that is asked for 127.0.0.1 asks itself.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetMaxReceiveMessageSize(-1);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  // In spite of its name this is how long one attempt may take; a busy machine needs more than the backoff
  // for it.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 5000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveTimeMs);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // as many as it takes while a stream waits
  return arguments;
}

// A channel whose calls all fail with `status`.
std::shared_ptr<grpc::Channel> BrokenChannel(const std::string& address, const absl::Status& status) {
  const grpc::Status error = ToGrpc(status);
  return grpc::CreateChannelInternal(
      "",
      grpc_lame_client_channel_create(address.c_str(), static_cast<grpc_status_code>(error.error_code()),
                                      error.error_message().c_str()),
      {});
}

}  // namespace

std::shared_ptr<grpc::Channel> MakeChannel(const std::string& address) {
  KeepGrpcInitialized();
  absl::StatusOr<Target> target = FindTarget(address);
  if (!target.ok()) return BrokenChannel(address, target.status());
  std::shared_ptr<grpc::Channel> channel =
      grpc::CreateCustomChannel(target->name, grpc::InsecureChannelCredentials(), Arguments());
  if (target->socket == nullptr) return channel;
  // Both live as long as the channel is used, for it connects again by the path.
  using Both = std::pair<std::shared_ptr<const SocketPath>, std::shared_ptr<grpc::Channel>>;
  const auto both = std::make_shared<Both>(std::move(target->socket), std::move(channel));
  return {both, both->second.get()};
}

}  // namespace dbr
