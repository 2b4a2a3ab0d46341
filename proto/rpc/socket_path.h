// Unix sockets in folders of any name.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace dbr {

// A path by which the kernel and gRPC reach a socket. The kernel takes at most 107 bytes, and gRPC reads a
// path as part of a URI and splits it at commas. Where the path that the user gave does not suit both, its
// folder is opened and reached as /proc/self/fd/N, which is short and plain:
//
//   unix:runs/short/replay.sock           ->  runs/short/replay.sock
//   unix:runs/as, long? as .../replay.sock  ->  /proc/self/fd/7/replay.sock
//
// The socket itself stays where the user has it, so that nothing must be cleaned up elsewhere. The folder is
// open as long as the object lives; a folder that is moved meanwhile is still reached. Immutable.
class SocketPath {
 public:
  // Touches the disk where the folder has to be opened. NotFound or PermissionDenied, naming the folder,
  // where it cannot be; InvalidArgument where the socket's own name is too long.
  static absl::StatusOr<std::shared_ptr<const SocketPath>> Open(const std::string& path);
  ~SocketPath();
  SocketPath(const SocketPath&) = delete;
  SocketPath& operator=(const SocketPath&) = delete;

  // For system calls: at most 107 bytes.
  const std::string& reachable() const { return reachable_; }
  // For gRPC: "unix:" with the path as gRPC decodes it.
  std::string GrpcAddress() const;

 private:
  SocketPath(std::string reachable, int folder) : reachable_(std::move(reachable)), folder_(folder) {}

  const std::string reachable_;
  const int folder_;  // file descriptor, or -1
};

// The bytes of `text` that stand for themselves in a URI, and the others as %XX.
std::string PercentEncode(const std::string& text);

}  // namespace dbr
