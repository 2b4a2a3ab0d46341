// Files that are whole or not there.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// Replaces `path` by `contents`: writes a temporary file beside it, fsync, rename, fsync of the folder. After
// a crash the old or the new contents stand there, never a mixture. Errors name the path and say what the
// system said (ResourceExhausted: disk full; PermissionDenied; NotFound: no such folder; Internal: others).
absl::Status WriteFileAtomically(const std::string& path, absl::string_view contents);

// NotFound, PermissionDenied or Internal, with the path.
absl::StatusOr<std::string> ReadFile(const std::string& path);

// Turns errno into a status whose message is "WHAT PATH: strerror".
absl::Status ErrnoStatus(int error_number, absl::string_view what, absl::string_view path);

}  // namespace dbr
