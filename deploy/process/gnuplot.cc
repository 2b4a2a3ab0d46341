#include "deploy/process/gnuplot.h"

#include <poll.h>
#include <signal.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "core/monotonic_clock.h"
#include "core/shutdown.h"
#include "core/status_macros.h"
#include "deploy/process/child_process.h"
#include "deploy/process/log_tail.h"

namespace dbr {
namespace {

// Finds gnuplot in the folders of PATH.
absl::StatusOr<std::string> FindGnuplot() {
  const char* path = std::getenv("PATH");
  for (const absl::string_view folder : absl::StrSplit(path == nullptr ? "" : path, ':', absl::SkipEmpty())) {
    const std::string program = absl::StrCat(folder, "/gnuplot");
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  return absl::FailedPreconditionError(
      "gnuplot is not installed, and plots need it: apt-get install gnuplot-nox");
}

// Blocks until the process of `pidfd` has ended. Returns false where the deadline came first.
bool WaitForEnd(int pidfd, absl::Duration deadline) {
  const absl::Time end = MonotonicNow() + deadline;
  for (;;) {
    const auto left = absl::ToInt64Milliseconds(end - MonotonicNow());
    if (left <= 0) return false;
    pollfd fds = {pidfd, POLLIN, 0};
    if (poll(&fds, 1, static_cast<int>(left)) > 0) return true;
  }
}

}  // namespace

absl::Status RunGnuplot(absl::string_view script, const std::string& folder, absl::Duration deadline) {
  ASSIGN_OR_RETURN(const std::string program, FindGnuplot());
  const std::string script_path = absl::StrCat(folder, "/plots.gp"), log = absl::StrCat(folder, "/plots.log");
  RETURN_IF_ERROR(WriteFileAtomically(script_path, script));
  ASSIGN_OR_RETURN(const StartedChild child, StartChild({.command = {program, script_path}, .log = log}));
  std::atomic<bool> interrupted = false;
  bool in_time = false;
  // The call is made by its number because glibc 2.36 declares pidfd_open() for C alone.
  const int pidfd = static_cast<int>(syscall(SYS_pidfd_open, child.pid, 0));
  if (pidfd >= 0) {
    const absl::Cleanup close_pidfd = [pidfd] { close(pidfd); };
    const ShutdownWatcher watcher([&interrupted, &child] {
      interrupted = true;
      kill(child.pid, SIGKILL);
    });
    in_time = WaitForEnd(pidfd, deadline);
  }
  if (!in_time) kill(child.pid, SIGKILL);
  int status = 0;
  while (waitpid(child.pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (interrupted) return absl::CancelledError("the drawing was stopped");
  if (!in_time) {
    return absl::DeadlineExceededError(
        absl::StrCat("gnuplot had not drawn ", script_path, " after ", absl::FormatDuration(deadline)));
  }
  if (status != 0) {
    return absl::InternalError(absl::StrCat("gnuplot ", DescribeExit(status), " while it drew ", script_path,
                                            ":\n", LogTail(log, child.log_start)));
  }
  std::error_code ignored;
  std::filesystem::remove(script_path, ignored);
  std::filesystem::remove(log, ignored);
  return absl::OkStatus();
}

}  // namespace dbr
