// Starting a child that cannot outlive its parent, and saying how one ended.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace dbr {

struct ChildOptions {
  std::vector<std::string> command;  // program with its path, then arguments
  std::string log;                   // takes stdout and stderr, appended
  pid_t group = 0;                   // the process group to join; one of its own where that is gone
  int kept_fd = -1;                  // stays open over the exec
};

struct StartedChild {
  pid_t pid = 0;
  off_t log_start = 0;  // the size of the log when it started
};

// Forks and executes. The child gets SIGTERM when the calling THREAD ends: call it from one that lives as
// long as the process. It starts with SIGINT and SIGTERM blocked, as our programs keep them
// (core/shutdown.h): one that comes early waits until the program asks for it. Does not block. Errors:
// NotFound or PermissionDenied where the log cannot be opened, Internal where there are too many processes; a
// program that cannot be executed says so in its log and exits with status 127.
absl::StatusOr<StartedChild> StartChild(const ChildOptions& options);

// "exited with status 1", "was killed by signal 9 (Killed)"; takes what waitpid gave.
std::string DescribeExit(int wait_status);

}  // namespace dbr
