// Starts a child that cannot outlive its parent, and describes how a child ended.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace dbr {

struct ChildOptions {
  std::vector<std::string> command;  // program with its path, then arguments
  std::string log;                   // takes stdout and stderr, appended
  pid_t group = 0;   // the process group to join; the child gets a group of its own where it is gone
  int kept_fd = -1;  // a file descriptor that stays open over the exec; -1: none
};

struct StartedChild {
  pid_t pid = 0;
  off_t log_start = 0;  // the size of the log in bytes when the child started
};

// Forks and executes. Does not block. The child gets SIGTERM when the calling THREAD ends, so call it from a
// thread that lives as long as the process. The child starts with SIGINT and SIGTERM blocked, as our programs
// keep them (core/shutdown.h): an early signal waits until the program asks for it. Returns NotFound or
// PermissionDenied where the log cannot be opened, and Internal where there are too many processes. A program
// that cannot be executed says so in its log and exits with status 127.
absl::StatusOr<StartedChild> StartChild(const ChildOptions& options);

// Describes an end: "exited with status 1", "was killed by signal 9 (Killed)". `wait_status` is what waitpid
// gave.
std::string DescribeExit(int wait_status);

}  // namespace dbr
