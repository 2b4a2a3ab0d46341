#include "tests/integration/dbr_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "core/check.h"
#include "core/file_io.h"
#include "core/monotonic_clock.h"

namespace dbr {
namespace {

int Milliseconds(absl::Duration duration) {
  return static_cast<int>(absl::ToInt64Milliseconds(std::max(duration, absl::ZeroDuration())));
}

}  // namespace

DbrProcess::DbrProcess(const std::string& program, std::vector<std::string> arguments,
                       std::vector<std::string> environment) {
  int ends[2];
  DBR_CHECK(pipe2(ends, O_CLOEXEC) == 0);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  arguments.insert(arguments.begin(), std::filesystem::path(DBR_BIN_DIR) / program);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  // The program runs without OPENBLAS_NUM_THREADS, as users start it.
  std::vector<char*> entries;
  for (std::string& entry : environment) entries.push_back(entry.data());
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (!absl::StartsWith(*entry, "OPENBLAS_NUM_THREADS=")) entries.push_back(*entry);
  }
  entries.push_back(nullptr);
  // As in a terminal: whoever runs the tests may have told them to ignore these.
  sigset_t heard;
  sigemptyset(&heard);
  for (const int number : {SIGINT, SIGHUP, SIGCHLD}) sigaddset(&heard, number);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setsigdefault(&attributes, &heard);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  DBR_CHECK(posix_spawn(&pid_, argv[0], &actions, &attributes, argv.data(), entries.data()) == 0);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  output_fd_ = ends[0];
}

DbrProcess::~DbrProcess() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  close(output_fd_);
}

DbrProcess::Read DbrProcess::ReadWithin(absl::Duration timeout) {
  pollfd waiting = {output_fd_, POLLIN, 0};
  if (poll(&waiting, 1, Milliseconds(timeout)) <= 0) return Read::kNothing;
  char bytes[4096];
  const ssize_t n = read(output_fd_, bytes, sizeof bytes);
  if (n <= 0) return Read::kEnd;
  output_.append(bytes, static_cast<std::size_t>(n));
  return Read::kMore;
}

bool DbrProcess::AwaitOutput(const std::string& words) {
  const absl::Time deadline = MonotonicNow() + kPatience;
  while (!absl::StrContains(output_, words)) {
    if (ReadWithin(deadline - MonotonicNow()) != Read::kMore) return false;
  }
  return true;
}

bool DbrProcess::Await(const std::function<bool()>& condition) {
  const absl::Time deadline = MonotonicNow() + kPatience;
  while (!condition()) {
    if (MonotonicNow() > deadline || ReadWithin(absl::Milliseconds(200)) == Read::kEnd) return false;
  }
  return true;
}

void DbrProcess::Signal(int number) const {
  kill(pid_, number);
}

int DbrProcess::Wait() {
  const absl::Time deadline = MonotonicNow() + kPatience;
  for (;;) {
    const Read read = ReadWithin(deadline - MonotonicNow());
    if (read == Read::kEnd) break;
    if (read == Read::kNothing) kill(pid_, SIGKILL);
  }
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

std::pair<int, std::string> RunProgram(const std::string& program, std::vector<std::string> arguments,
                                       std::vector<std::string> environment) {
  DbrProcess process(program, std::move(arguments), std::move(environment));
  const int status = process.Wait();
  return {status, process.output()};
}

std::vector<pid_t> ProcessesOf(const std::string& program, const std::string& words) {
  std::vector<pid_t> found;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    pid_t pid = 0;
    if (!absl::SimpleAtoi(entry.path().filename().string(), &pid)) continue;
    const absl::StatusOr<std::string> command = ReadFile(entry.path() / "cmdline");
    if (command.ok() && absl::StrContains(*command, program) && absl::StrContains(*command, words))
      found.push_back(pid);
  }
  return found;
}

bool AllEndWithin(const std::vector<pid_t>& processes, absl::Duration timeout) {
  const absl::Time deadline = MonotonicNow() + timeout;
  for (const pid_t pid : processes) {
    const int fd = static_cast<int>(syscall(SYS_pidfd_open, pid, 0));
    if (fd < 0) continue;  // the process has ended
    pollfd waiting = {fd, POLLIN, 0};
    const bool ended = poll(&waiting, 1, Milliseconds(deadline - MonotonicNow())) == 1;
    close(fd);
    if (!ended) return false;
  }
  return true;
}

}  // namespace dbr
