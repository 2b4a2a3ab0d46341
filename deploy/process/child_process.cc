#include "deploy/process/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"

namespace dbr {
namespace {

constexpr int kCannotExec = 127;

// The child's side of the fork. It makes only async-signal-safe calls, because the parent may have other
// threads by now.
[[noreturn]] void RunChild(char* const* arguments, pid_t parent, pid_t group, int log, int kept_fd) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(kCannotExec);  // the parent died before the line above
  // A terminal's Ctrl-C does not reach this group. The launcher stops its children in order.
  if (setpgid(0, group) != 0) setpgid(0, 0);
  sigset_t blocked;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGINT);
  sigaddset(&blocked, SIGTERM);
  sigprocmask(SIG_SETMASK, &blocked, nullptr);
  signal(SIGPIPE, SIG_DFL);
  const int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
  dup2(null, STDIN_FILENO);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  if (kept_fd >= 0) fcntl(kept_fd, F_SETFD, 0);
  execv(arguments[0], arguments);
  const char* why = strerrordesc_np(errno);
  for (const char* part : {"cannot run ", static_cast<const char*>(arguments[0]), ": ", why, "\n"}) {
    [[maybe_unused]] const ssize_t n = write(STDERR_FILENO, part, std::strlen(part));
  }
  _exit(kCannotExec);
}

}  // namespace

absl::StatusOr<StartedChild> StartChild(const ChildOptions& options) {
  const int log = open(options.log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (log < 0) return ErrnoStatus(errno, "cannot open the log", options.log);
  StartedChild child;
  child.log_start = lseek(log, 0, SEEK_END);
  std::vector<std::string> arguments = options.command;
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  const pid_t parent = getpid();
  child.pid = fork();
  if (child.pid == 0) RunChild(pointers.data(), parent, options.group, log, options.kept_fd);
  const int error_number = errno;
  close(log);
  if (child.pid < 0) return ErrnoStatus(error_number, "cannot fork for", options.command[0]);
  return child;
}

std::string DescribeExit(int wait_status) {
  if (WIFSIGNALED(wait_status)) {
    const int number = WTERMSIG(wait_status);
    return absl::StrCat("was killed by signal ", number, " (", strsignal(number), ")");
  }
  return absl::StrCat("exited with status ", WEXITSTATUS(wait_status));
}

}  // namespace dbr
