// How each of our clients connects.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

namespace dbr {

// A channel to an address (proto/rpc/address.h) with a connection that no other channel shares and that goes
// through no proxy, whatever the environment names. It connects in the background and reconnects by itself
// within a second of the server's return; a connection whose other end has vanished is given up after the
// times of proto/rpc/keepalive.h. Replies may be of any size. Where the address is none, or the folder of its
// socket cannot be opened (proto/rpc/socket_path.h), each call fails at once with that error. Initializes
// gRPC for the rest of the process.
std::shared_ptr<grpc::Channel> MakeChannel(const std::string& address);

}  // namespace dbr
