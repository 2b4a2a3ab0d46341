// Reading and writing whole files. Free functions without state, for any thread.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// Replaces `path` by `contents`: writes a temporary file beside it, calls fsync, renames it and calls fsync
// on the folder. After a crash the old or the new contents stand there, never a mixture. Blocks. Errors name
// the path and the system's reason (ResourceExhausted: disk full; PermissionDenied; NotFound: no such folder;
// Internal: others).
absl::Status WriteFileAtomically(const std::string& path, absl::string_view contents);

// The whole of a file. NotFound, PermissionDenied or Internal, with the path. Blocks.
absl::StatusOr<std::string> ReadFile(const std::string& path);

// Turns errno into a status whose message is "WHAT PATH: strerror".
absl::Status ErrnoStatus(int error_number, absl::string_view what, absl::string_view path);

}  // namespace dbr
