// Keeps child processes running, restarts them within limits, and leaves none behind.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/exit_status.h"
#include "deploy/process/guard.h"

namespace dbr {

// The exit status of our programs for wrong flags, a wrong config or another final error.
inline constexpr int kBadConfigExit = kFinalExit;

struct ProcessSpec {
  std::string name;                            // "actor-0"
  std::vector<std::string> command;            // program with its path, then arguments
  std::vector<std::string> restart_arguments;  // added at a restart, for example --resume
  std::string log;                             // takes stdout and stderr, appended
  int stop_rank = 0;  // lower ranks are stopped, and have ended, before higher ones are stopped
  absl::Duration stop_grace = absl::Seconds(30);  // from SIGTERM to SIGKILL
  bool once = false;  // any end is no failure and no reason for a restart: TakeEnded returns it
};

// A process started with `once` that has ended.
struct EndedProcess {
  std::string name;
  int wait_status = 0;  // as waitpid gives it
  off_t log_start = 0;  // the offset (bytes) in its log where its own lines begin
};

struct SupervisorOptions {
  std::uint32_t max_restarts = 5;  // the restarts of one process within restart_window
  absl::Duration restart_window = absl::Minutes(5);
  absl::Duration first_restart_delay =
      absl::Milliseconds(200);                     // doubles with each restart within the window
  absl::Duration orphan_grace = absl::Minutes(1);  // the time for children to end when this process is killed
  // Receives one line at each start, death, restart and kill, from Start, Wait and Stop. `notable` is true
  // where nobody asked for the event. For a child that failed while it was stopped, the last lines of its log
  // follow.
  std::function<void(const std::string& event, bool notable)> on_event = [](const std::string&, bool) {};
};

// Owns its children. All calls except Wake must come from one thread: the one that creates it. That thread
// must live as long as the process, because the kernel ends children with the thread that started them.
// Create it before the process starts other threads: it blocks SIGCHLD and the StopSignals() with SIGHUP
// (core/shutdown.h), and receives them from then on.
class Supervisor {
 public:
  // Returns Internal where the signals cannot be blocked, and the errors of Guard::Start and of making file
  // descriptors.
  static absl::StatusOr<std::unique_ptr<Supervisor>> Create(SupervisorOptions options);
  ~Supervisor();  // calls Stop()
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  // Starts a child. Returns NotFound where the program or the log's folder does not exist, PermissionDenied,
  // or ResourceExhausted.
  absl::Status Start(ProcessSpec spec);

  // Blocks until `deadline`, Wake(), a signal or the end of a child, and restarts children that died. An
  // error means that the whole cannot continue. It names the first failure with its exit status or signal and
  // the last lines of its log: InvalidArgument where a child ended with kBadConfigExit, Aborted where one
  // died too often.
  absl::Status Wait(absl::Time deadline);

  // Returns the processes with `once` that have ended since the last call, in the order in which they were
  // started.
  std::vector<EndedProcess> TakeEnded();

  // Sets whether children that die are restarted, which is true at first. If false, Wait returns Aborted at
  // the first death.
  void set_restarting(bool restarting) { restarting_ = restarting; }

  // Ends the current Wait, or the next one. Thread-safe.
  void Wake();

  // The number of stop signals (core/shutdown.h) so far. A SIGHUP after another signal does not count.
  int stop_signals() const { return stop_signals_; }
  std::uint64_t restarts() const { return restarts_; }
  // Returns 0 where there is no child of that name or it does not run now.
  pid_t pid(const std::string& name) const;

  // Stops the children of each rank up to `last_rank` in turn: sends SIGTERM, and SIGKILL to those that still
  // run after their grace or at the next stop signal; where there was none before, at the second. Blocks
  // until all of them have ended. Returns whether every one ended by itself with status 0. Processes with
  // `once` do not count.
  bool Stop(int last_rank = std::numeric_limits<int>::max());

 private:
  struct Child;

  Supervisor(SupervisorOptions options, std::unique_ptr<Guard> guard, int signal_fd, int wake_fd);
  absl::Status Spawn(Child* child, bool again);
  absl::Status RestartDue();
  static std::string LastWords(const Child& child, int lines = 5);
  absl::Status OnDeath(Child* child, int wait_status);
  void NoteEnd(Child* child, int wait_status);
  absl::Status ReapAll();
  absl::Time NextRestart() const;
  bool StopRank(int rank);
  bool ReapStopped(int rank, bool* clean);
  void KillRank(int rank, bool interrupted);
  void Poll(absl::Time deadline);

  const SupervisorOptions options_;
  const std::unique_ptr<Guard> guard_;
  const int signal_fd_;
  const int wake_fd_;
  std::vector<std::unique_ptr<Child>> children_;
  std::string first_failure_;
  std::uint64_t restarts_ = 0;
  int stop_signals_ = 0;
  bool restarting_ = true;
};

}  // namespace dbr
