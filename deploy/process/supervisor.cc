#include "deploy/process/supervisor.h"

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/file_io.h"
#include "core/monotonic_clock.h"
#include "core/shutdown.h"
#include "core/status_macros.h"
#include "deploy/process/child_process.h"
#include "deploy/process/log_tail.h"

namespace dbr {
namespace {

sigset_t WatchedSignals() {
  sigset_t set = StopSignals(/*hangup=*/true);
  sigaddset(&set, SIGCHLD);
  return set;
}

// Whether a child has ended, and how.
bool HasEnded(pid_t pid, int* wait_status) {
  const pid_t ended = waitpid(pid, wait_status, WNOHANG);
  if (ended >= 0) return ended == pid;
  *wait_status = SIGKILL;  // somebody else has taken the status; that it failed is the safe reading
  return errno == ECHILD;
}

}  // namespace

struct Supervisor::Child {
  ProcessSpec spec;
  pid_t pid = 0;                  // 0: it does not run
  std::optional<int> ended = {};  // with `once`: the wait status of its end
  off_t log_start = 0;            // the offset in the log where this start begins
  absl::Time restart_at = absl::InfiniteFuture();
  std::deque<absl::Time> restarts;  // the times of restarts within the window
};

absl::StatusOr<std::unique_ptr<Supervisor>> Supervisor::Create(SupervisorOptions options) {
  // A parent may have told us to ignore it, and then the kernel would take the children's statuses.
  signal(SIGCHLD, SIG_DFL);
  const sigset_t signals = WatchedSignals();
  if (pthread_sigmask(SIG_BLOCK, &signals, nullptr) != 0) return absl::InternalError("cannot block signals");
  ASSIGN_OR_RETURN(std::unique_ptr<Guard> guard, Guard::Start(options.orphan_grace));
  const int signal_fd = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  if (signal_fd < 0) return ErrnoStatus(errno, "cannot watch", "signals");
  const int wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (wake_fd < 0) return ErrnoStatus(errno, "cannot open", "an event file");
  return std::unique_ptr<Supervisor>(
      new Supervisor(std::move(options), std::move(guard), signal_fd, wake_fd));
}

Supervisor::Supervisor(SupervisorOptions options, std::unique_ptr<Guard> guard, int signal_fd, int wake_fd)
    : options_(std::move(options)), guard_(std::move(guard)), signal_fd_(signal_fd), wake_fd_(wake_fd) {}

Supervisor::~Supervisor() {
  Stop();
  close(signal_fd_);
  close(wake_fd_);
}

absl::Status Supervisor::Start(ProcessSpec spec) {
  if (access(spec.command[0].c_str(), X_OK) != 0) return ErrnoStatus(errno, "cannot run", spec.command[0]);
  children_.push_back(std::make_unique<Child>());
  Child* child = children_.back().get();
  child->spec = std::move(spec);
  return Spawn(child, /*again=*/false);
}

absl::Status Supervisor::Spawn(Child* child, bool again) {
  const ProcessSpec& spec = child->spec;
  std::vector<std::string> arguments = spec.command;
  if (again) {
    for (const std::string& argument : spec.restart_arguments) {
      if (std::find(arguments.begin(), arguments.end(), argument) == arguments.end())
        arguments.push_back(argument);
    }
  }
  ASSIGN_OR_RETURN(const StartedChild started,
                   StartChild({arguments, spec.log, guard_->group(), guard_->child_fd()}));
  child->pid = started.pid;
  child->log_start = started.log_start;
  child->restart_at = absl::InfiniteFuture();
  options_.on_event(absl::StrCat(spec.name, again ? " started again" : " started", " (process ", child->pid,
                                 "): ", absl::StrJoin(arguments, " ")),
                    /*notable=*/false);
  return absl::OkStatus();
}

// Returns the text that follows the message of a child's end.
std::string Supervisor::LastWords(const Child& child, int lines) {
  const std::string tail = LogTail(child.spec.log, child.log_start, lines);
  if (tail.empty()) return ", saying nothing";
  return absl::StrCat(lines == 1 ? ", its last line:\n" : ", its last lines:\n", tail);
}

absl::Status Supervisor::Wait(absl::Time deadline) {
  RETURN_IF_ERROR(RestartDue());
  Poll(std::min(deadline, NextRestart()));
  RETURN_IF_ERROR(ReapAll());
  return RestartDue();
}

void Supervisor::Wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t n = write(wake_fd_, &one, sizeof one);  // full: it is awake already
}

// Blocks until `deadline` or an event, and reads the signals that came.
void Supervisor::Poll(absl::Time deadline) {
  const absl::Duration left = std::clamp(deadline - MonotonicNow(), absl::ZeroDuration(), absl::Hours(1));
  pollfd fds[2] = {{signal_fd_, POLLIN, 0}, {wake_fd_, POLLIN, 0}};
  poll(fds, 2, static_cast<int>(absl::ToInt64Milliseconds(absl::Ceil(left, absl::Milliseconds(1)))));
  std::uint64_t wakes;
  [[maybe_unused]] const ssize_t n = read(wake_fd_, &wakes, sizeof wakes);
  signalfd_siginfo info;
  while (read(signal_fd_, &info, sizeof info) == sizeof info) {
    // A terminal that closes asks for a stop. Its SIGHUP after another signal is not a second request.
    const bool hangup_again = info.ssi_signo == SIGHUP && stop_signals_ > 0;
    if (info.ssi_signo != SIGCHLD && !hangup_again) ++stop_signals_;
  }
}

absl::Status Supervisor::ReapAll() {
  for (const auto& child : children_) {
    int status = 0;
    if (child->pid == 0 || !HasEnded(child->pid, &status)) continue;
    if (child->spec.once) {
      NoteEnd(child.get(), status);
    } else {
      RETURN_IF_ERROR(OnDeath(child.get(), status));
    }
  }
  return absl::OkStatus();
}

void Supervisor::NoteEnd(Child* child, int wait_status) {
  child->pid = 0;
  child->ended = wait_status;
  options_.on_event(absl::StrCat(child->spec.name, " ", DescribeExit(wait_status)), /*notable=*/false);
}

std::vector<EndedProcess> Supervisor::TakeEnded() {
  std::vector<EndedProcess> ended;
  for (const auto& child : children_) {
    if (child->ended.has_value()) ended.push_back({child->spec.name, *child->ended, child->log_start});
  }
  std::erase_if(children_, [](const auto& child) { return child->ended.has_value(); });
  return ended;
}

// Plans the restart of a child that died. Returns the reason where there is none.
absl::Status Supervisor::OnDeath(Child* child, int wait_status) {
  const ProcessSpec& spec = child->spec;
  child->pid = 0;
  const std::string death = absl::StrCat(spec.name, " ", DescribeExit(wait_status));
  const std::string failure = absl::StrCat(death, LastWords(*child));
  if (first_failure_.empty()) first_failure_ = failure;
  if (WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == kBadConfigExit) {
    options_.on_event(absl::StrCat(death, ": not started again"), /*notable=*/false);
    return absl::InvalidArgumentError(absl::StrCat(failure, "\n  whole log: ", spec.log));
  }
  if (!restarting_) {
    options_.on_event(death, /*notable=*/true);
    return absl::AbortedError(absl::StrCat(failure, "\n  whole log: ", spec.log));
  }
  const absl::Time now = MonotonicNow();
  while (!child->restarts.empty() && child->restarts.front() < now - options_.restart_window) {
    child->restarts.pop_front();
  }
  if (child->restarts.size() >= options_.max_restarts) {
    options_.on_event(absl::StrCat(death, ": died too often"), /*notable=*/true);
    return absl::AbortedError(absl::StrCat(
        spec.name, " died ", child->restarts.size() + 1, " times within ",
        absl::FormatDuration(options_.restart_window), " (launch.max_restarts = ", options_.max_restarts,
        "). First failure: ", first_failure_, "\n  whole log: ", spec.log));
  }
  const int doublings = std::min<int>(6, static_cast<int>(child->restarts.size()));
  child->restart_at = now + options_.first_restart_delay * (1 << doublings);
  child->restarts.push_back(now);
  options_.on_event(
      absl::StrCat(death, ": starting it again (", child->restarts.size(), " of at most ",
                   options_.max_restarts, " within ", absl::FormatDuration(options_.restart_window), ")",
                   LastWords(*child, /*lines=*/1)),
      /*notable=*/true);
  return absl::OkStatus();
}

absl::Time Supervisor::NextRestart() const {
  absl::Time next = absl::InfiniteFuture();
  for (const auto& child : children_) next = std::min(next, child->restart_at);
  return next;
}

absl::Status Supervisor::RestartDue() {
  for (const auto& child : children_) {
    if (child->restart_at > MonotonicNow()) continue;
    ++restarts_;
    RETURN_IF_ERROR(Spawn(child.get(), /*again=*/true));
  }
  return absl::OkStatus();
}

pid_t Supervisor::pid(const std::string& name) const {
  for (const auto& child : children_) {
    if (child->spec.name == name) return child->pid;
  }
  return 0;
}

bool Supervisor::Stop(int last_rank) {
  std::set<int> ranks;
  for (const auto& child : children_) {
    if (child->spec.stop_rank <= last_rank) ranks.insert(child->spec.stop_rank);
  }
  bool clean = true;
  for (const int rank : ranks) clean = StopRank(rank) && clean;
  return clean;
}

bool Supervisor::StopRank(int rank) {
  absl::Time deadline = absl::InfinitePast();
  bool clean = true;
  for (const auto& child : children_) {
    if (child->spec.stop_rank != rank) continue;
    if (child->restart_at != absl::InfiniteFuture()) {
      // It died of something else and was to be started again, so that nothing was saved.
      clean = false;
      child->restart_at = absl::InfiniteFuture();
      options_.on_event(
          absl::StrCat(child->spec.name, " had died and is not started again, for all is stopped: ",
                       "what it did after it last saved is lost"),
          /*notable=*/true);
    }
    if (child->pid == 0) continue;
    kill(child->pid, SIGTERM);
    deadline = std::max(deadline, MonotonicNow() + child->spec.stop_grace);
  }
  const int signals_before = stop_signals_;
  bool killed = false, told = false;
  while (ReapStopped(rank, &clean)) {
    Poll(deadline);
    // The first signal of all asks for what is being done already.
    const bool interrupted = stop_signals_ != signals_before && stop_signals_ > 1;
    if (stop_signals_ == 1 && signals_before == 0 && !std::exchange(told, true))
      options_.on_event("stopping and saving already; another signal kills what has not ended",
                        /*notable=*/true);
    if (killed || (!interrupted && MonotonicNow() < deadline)) continue;
    if (!ReapStopped(rank, &clean)) break;
    KillRank(rank, interrupted);
    killed = true;
    deadline = absl::InfiniteFuture();
  }
  return clean;
}

// Reaps the children of a rank that have ended. Returns true while one still runs.
bool Supervisor::ReapStopped(int rank, bool* clean) {
  bool running = false;
  for (const auto& child : children_) {
    if (child->spec.stop_rank != rank || child->pid == 0) continue;
    int status = 0;
    if (!HasEnded(child->pid, &status)) {
      running = true;
      continue;
    }
    if (child->spec.once) {
      NoteEnd(child.get(), status);
      continue;
    }
    child->pid = 0;
    if (status == 0) continue;
    *clean = false;
    // It may have failed by itself just before, and be the reason why the others failed.
    options_.on_event(absl::StrCat(child->spec.name, " ", DescribeExit(status), " when it was stopped",
                                   WIFEXITED(status) ? LastWords(*child) : ""),
                      /*notable=*/true);
  }
  return running;
}

void Supervisor::KillRank(int rank, bool interrupted) {
  for (const auto& child : children_) {
    if (child->spec.stop_rank != rank || child->pid == 0) continue;
    options_.on_event(
        absl::StrCat(child->spec.name, " killed: ",
                     interrupted ? std::string("a second signal came")
                                 : absl::StrCat("still there ", absl::FormatDuration(child->spec.stop_grace),
                                                " after SIGTERM")),
        /*notable=*/true);
    kill(child->pid, SIGKILL);
  }
}

}  // namespace dbr
