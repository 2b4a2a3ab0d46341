#include "deploy/process/guard.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "core/file_io.h"

namespace dbr {
namespace {

// Blocks until nobody holds the other end of the pipe. Returns false after the timeout.
bool WaitForHangup(int fd, int timeout_ms) {
  pollfd waiting = {fd, 0, 0};  // POLLHUP is always reported
  for (;;) {
    const int n = poll(&waiting, 1, timeout_ms);
    if (n < 0 && errno == EINTR) continue;
    return n > 0;
  }
}

// The guard's whole life. It makes only async-signal-safe calls, because it runs in a fork.
[[noreturn]] void RunGuard(const std::array<int, 2>& launcher, const std::array<int, 2>& children,
                           int grace_ms) {
  close(launcher[1]);
  close(children[1]);
  setpgid(0, 0);
  prctl(PR_SET_NAME, "dbr-guard");
  sigset_t all;
  sigfillset(&all);
  sigprocmask(SIG_SETMASK, &all, nullptr);
  const int null = open("/dev/null", O_RDWR);
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(null, fd);
  // Everything else that the launcher has open, its own output above all, must not stay open here.
  const int low = std::min(launcher[0], children[0]);
  const int high = std::max(launcher[0], children[0]);
  close_range(3, low - 1, 0);
  close_range(low + 1, high - 1, 0);
  close_range(high + 1, ~0U, 0);
  WaitForHangup(launcher[0], -1);
  if (!WaitForHangup(children[0], grace_ms)) kill(0, SIGKILL);
  _exit(0);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Guard>> Guard::Start(absl::Duration grace) {
  std::array<int, 2> launcher, children;
  if (pipe2(launcher.data(), O_CLOEXEC) != 0) return ErrnoStatus(errno, "cannot open", "a pipe to the guard");
  if (pipe2(children.data(), O_CLOEXEC) != 0) {
    const int error_number = errno;
    for (const int fd : launcher) close(fd);
    return ErrnoStatus(error_number, "cannot open", "a pipe to the guard");
  }
  const pid_t pid = fork();
  if (pid == 0) RunGuard(launcher, children, static_cast<int>(absl::ToInt64Milliseconds(grace)));
  const int error_number = errno;
  close(launcher[0]);
  close(children[0]);
  if (pid < 0) {
    close(launcher[1]);
    close(children[1]);
    return ErrnoStatus(error_number, "cannot fork", "the guard");
  }
  setpgid(pid, pid);  // the guard does so too: either may be first
  return std::unique_ptr<Guard>(new Guard(pid, launcher[1], children[1]));
}

Guard::~Guard() {
  close(child_fd_);
  close(launcher_fd_);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
}

}  // namespace dbr
