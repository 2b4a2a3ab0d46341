// A clean end on SIGINT and SIGTERM.
#pragma once

#include <signal.h>

#include <functional>
#include <thread>

namespace dbr {

// The signals that ask this process to stop: SIGTERM; SIGINT, unless it was told to ignore that, as a shell
// tells the commands that it starts in the background; and with `hangup` SIGHUP, unless it was told to ignore
// that, as nohup does.
sigset_t StopSignals(bool hangup = false);

// Ignores SIGPIPE and SIGXFSZ: a pipe without a reader, and a file that reaches the limit of `ulimit -f`, are
// errors of the write.
void IgnoreWriteSignals();

// Blocks the StopSignals() in the calling thread and in all threads it starts later, and ignores those of
// writes. It is the first line of every service's main: a gRPC thread that existed before would take the
// signal and nothing would drain. A command that has nothing to save does without, and a signal ends it.
void BlockShutdownSignals();

// Starts a thread in which all signals are blocked: they are for the process's other threads, also for one
// that will only block or wait for them later.
std::thread ThreadWithoutSignals(std::function<void()> run);

// Opens a descriptor that can be read from (poll) while one of the StopSignals() waits to be taken, for
// whoever waits for something else besides. The caller closes it, and reads nothing from it. -1, with errno,
// where the system has none left.
int OpenShutdownSignals();

// Runs `on_signal` in a thread of its own at each of the StopSignals(), until destroyed; the destructor joins
// the thread. Blocks these signals in the calling thread, and leaves them blocked; threads that were started
// before must have them blocked already.
class ShutdownWatcher {
 public:
  explicit ShutdownWatcher(std::function<void()> on_signal);
  ~ShutdownWatcher();
  ShutdownWatcher(const ShutdownWatcher&) = delete;
  ShutdownWatcher& operator=(const ShutdownWatcher&) = delete;

 private:
  int signal_fd_;
  int stop_fd_;
  std::thread thread_;
};

}  // namespace dbr
