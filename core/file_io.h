// Reading and writing whole files. Free functions without state, for any thread.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// Replaces `path` by `contents`: writes a temporary file beside it (core/temporary_file.h), calls fsync,
// renames it and calls fsync on the folder. After a crash the old or the new contents stand there, never a
// mixture; what a killed process left beside is removed by the next write in the folder. Blocks. Errors name
// the path and the system's reason (ResourceExhausted: disk full; PermissionDenied; NotFound: no such folder;
// Internal: others).
absl::Status WriteFileAtomically(const std::string& path, absl::string_view contents);

// The whole of a regular file, of 4 GiB at most. Errors name the path: NotFound, PermissionDenied,
// InvalidArgument (a folder, a pipe, a device, a larger file) or Internal. Blocks for the disk and never for
// another program.
absl::StatusOr<std::string> ReadFile(const std::string& path);

// The whole of a text that a person wrote, of 16 MiB at most and without the byte order mark that some
// editors put before it. `path` is a regular file or a pipe, such as /dev/stdin or what a shell makes of
// <(...). Errors are ReadFile's, InvalidArgument also for UTF-16. Blocks until whoever writes into the pipe
// has closed it; Cancelled where SIGINT or SIGTERM, which are blocked (core/shutdown.h), comes before. Call
// it while there is no ShutdownWatcher, which would take the signal.
absl::StatusOr<std::string> ReadTextFile(const std::string& path);

// Checks that `fd`, which `path` was opened as, is a regular file. InvalidArgument, saying what it is.
absl::Status CheckRegularFile(int fd, absl::string_view path);

// Turns errno into a status whose message is "WHAT PATH: strerror".
absl::Status ErrnoStatus(int error_number, absl::string_view what, absl::string_view path);

}  // namespace dbr
