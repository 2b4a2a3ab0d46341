// gRPC's own state, which outlives every channel and server of a process.
#pragma once

#include <grpc/grpc.h>

namespace dbr {

// Initializes the library, once, until the process ends. Without it the end of the last channel or server
// shuts the library down, which joins one of the library's threads, and that thread may sit in a poll of ten
// seconds. Thread-safe.
inline void KeepGrpcInitialized() {
  [[maybe_unused]] static const bool kept = (grpc_init(), true);
}

}  // namespace dbr
