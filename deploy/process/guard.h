// A process that ends the remaining children when the launcher itself is killed.
#pragma once

#include <sys/types.h>

#include <memory>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace dbr {

// A small forked process that leads the process group of all children. When the launcher dies, the kernel
// sends SIGTERM to the children (PR_SET_PDEATHSIG). The guard gives them `grace` to end and then kills the
// group, so that not even a child that hangs survives. One thread at a time.
//
//   launcher ---- pipe ---- guard ---- pipe ---- every child
//
// The launcher's end closes when it dies. The children's end closes when the last of them has ended.
class Guard {
 public:
  // Starts the guard. Requires that the process has no other threads yet. Returns an error where a pipe or
  // the process cannot be made.
  static absl::StatusOr<std::unique_ptr<Guard>> Start(absl::Duration grace);
  ~Guard();  // ends the guard and blocks until it has ended; every child must have ended before
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;

  pid_t group() const { return pid_; }
  // Every child must keep this open over its exec. Its closing tells the guard that all children have ended.
  int child_fd() const { return child_fd_; }

 private:
  Guard(pid_t pid, int launcher_fd, int child_fd)
      : pid_(pid), launcher_fd_(launcher_fd), child_fd_(child_fd) {}

  pid_t pid_;
  int launcher_fd_;  // the kernel closes it when the launcher dies
  int child_fd_;
};

}  // namespace dbr
