// Child processes that are kept running, restarted within bounds, and never left behind.
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
#include "deploy/process/guard.h"

namespace dbr {

// The exit status by which our programs say that their flags or config are wrong: starting again would not
// help.
inline constexpr int kBadConfigExit = 2;

struct ProcessSpec {
  std::string name;                            // "actor-0"
  std::vector<std::string> command;            // program with its path, then arguments
  std::vector<std::string> restart_arguments;  // added when it is started again, for example --resume
  std::string log;                             // takes stdout and stderr, appended
  int stop_rank = 0;                           // lower ranks are stopped, and waited for, before higher ones
  absl::Duration stop_grace = absl::Seconds(30);  // from SIGTERM to SIGKILL
  bool once = false;  // its end, however it comes, is no failure and never a restart: TakeEnded tells of it
};

// A process started with `once` that is over.
struct EndedProcess {
  std::string name;
  int wait_status = 0;  // as waitpid gives it
  off_t log_start = 0;  // where its words begin in its log
};

struct SupervisorOptions {
  std::uint32_t max_restarts = 5;  // of one process within restart_window
  absl::Duration restart_window = absl::Minutes(5);
  absl::Duration first_restart_delay =
      absl::Milliseconds(200);                     // doubles with each restart within the window
  absl::Duration orphan_grace = absl::Minutes(1);  // what children have to end when this process is killed
  // Called with one line at each start, death, restart and kill, from Start, Wait and Stop; `notable` where
  // that was not asked for. Below the line on a child that failed while it was stopped stand its last words.
  std::function<void(const std::string& event, bool notable)> on_event = [](const std::string&, bool) {};
};

// Owns its children. All calls but Wake come from one thread, the one that creates it and lives as long as
// the process: the kernel ends children with the thread that started them. Create it before the process
// starts other threads: it blocks SIGCHLD, SIGINT, SIGTERM and SIGHUP, and takes them from then on.
class Supervisor {
 public:
  static absl::StatusOr<std::unique_ptr<Supervisor>> Create(SupervisorOptions options);
  ~Supervisor();  // Stop()
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  // NotFound where the program or the log's folder does not exist, PermissionDenied, ResourceExhausted.
  absl::Status Start(ProcessSpec spec);

  // Blocks until `deadline`, Wake(), a signal or the end of a child, and starts children that died again. An
  // error means that the whole cannot go on, and names the first failure with its exit status or signal and
  // the last lines of its log: InvalidArgument where a child refused its config, Aborted where one died too
  // often.
  absl::Status Wait(absl::Time deadline);

  // Those with `once` that have ended since the last call, in the order in which they were started.
  std::vector<EndedProcess> TakeEnded();

  // Whether children that die are started again (they are, at first). Where not, Wait answers Aborted at the
  // first death.
  void set_restarting(bool restarting) { restarting_ = restarting; }

  // Ends the Wait under way, or the next one. Thread-safe.
  void Wake();

  // SIGINT, SIGTERM and SIGHUP so far; a SIGHUP after another signal does not count.
  int stop_signals() const { return stop_signals_; }
  std::uint64_t restarts() const { return restarts_; }
  // 0 where there is none of that name or it does not run now.
  pid_t pid(const std::string& name) const;

  // SIGTERM to each rank up to `last_rank` in turn, SIGKILL to what is still there after its grace, or at the
  // next stop signal. Blocks until all of them have ended. True where every one ended by itself with status
  // 0; how those with `once` ended does not count.
  bool Stop(int last_rank = std::numeric_limits<int>::max());

 private:
  struct Child;

  Supervisor(SupervisorOptions options, std::unique_ptr<Guard> guard, int signal_fd, int wake_fd);
  absl::Status Spawn(Child* child, bool again);
  absl::Status RestartDue();
  static std::string LastWords(const Child& child);
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
