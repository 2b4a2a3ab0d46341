// The process that ends what is left when the launcher itself is killed.
#pragma once

#include <sys/types.h>

#include <memory>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace dbr {

// A small forked process that leads the process group of all children. Children get SIGTERM from the kernel
// when the launcher dies (PR_SET_PDEATHSIG); the guard gives them `grace` to end and then kills the group, so
// that a child that hangs is no orphan either. One thread at a time. Start it before the process has other
// threads.
class Guard {
 public:
  static absl::StatusOr<std::unique_ptr<Guard>> Start(absl::Duration grace);
  ~Guard();  // lets the guard end and waits for it; every child has ended before
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;

  pid_t group() const { return pid_; }
  // To be kept open by every child over its exec; the guard reads the end of all children from it.
  int child_fd() const { return child_fd_; }

 private:
  Guard(pid_t pid, int launcher_fd, int child_fd)
      : pid_(pid), launcher_fd_(launcher_fd), child_fd_(child_fd) {}

  pid_t pid_;
  int launcher_fd_;  // closed by the kernel when the launcher dies
  int child_fd_;
};

}  // namespace dbr
