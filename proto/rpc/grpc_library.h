// gRPC's own state, which outlives every channel and server of a process.
#pragma once

#include <grpc/grpc.h>

namespace dbr {

// Keeps the library initialized until the process ends. Without it the end of the last channel or server
// shuts the library down, and that joins a thread of its own which may sit in a poll of ten seconds.
inline void KeepGrpcInitialized() {
  [[maybe_unused]] static const bool kept = (grpc_init(), true);
}

}  // namespace dbr
