#include "core/shutdown.h"

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <cstdint>
#include <utility>

#include "core/check.h"

namespace dbr {
namespace {

bool IsIgnored(int signal_number) {
  struct sigaction action {};
  return sigaction(signal_number, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

sigset_t StopSignals(bool hangup) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  if (!IsIgnored(SIGINT)) sigaddset(&set, SIGINT);
  if (hangup && !IsIgnored(SIGHUP)) sigaddset(&set, SIGHUP);
  return set;
}

void IgnoreWriteSignals() {
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

void BlockShutdownSignals() {
  const sigset_t set = StopSignals();
  DBR_CHECK(pthread_sigmask(SIG_BLOCK, &set, nullptr) == 0);
  IgnoreWriteSignals();
}

std::thread ThreadWithoutSignals(std::function<void()> run) {
  sigset_t all, before;
  sigfillset(&all);
  DBR_CHECK(pthread_sigmask(SIG_SETMASK, &all, &before) == 0);
  std::thread thread(std::move(run));
  DBR_CHECK(pthread_sigmask(SIG_SETMASK, &before, nullptr) == 0);
  return thread;
}

int OpenShutdownSignals() {
  const sigset_t set = StopSignals();
  return signalfd(-1, &set, SFD_CLOEXEC);
}

ShutdownWatcher::ShutdownWatcher(std::function<void()> on_signal) {
  BlockShutdownSignals();
  signal_fd_ = OpenShutdownSignals();
  stop_fd_ = eventfd(0, EFD_CLOEXEC);
  DBR_CHECK(signal_fd_ >= 0 && stop_fd_ >= 0);
  thread_ = std::thread([this, on_signal = std::move(on_signal)] {
    for (;;) {
      pollfd fds[2] = {{signal_fd_, POLLIN, 0}, {stop_fd_, POLLIN, 0}};
      if (poll(fds, 2, -1) < 0) continue;
      if (fds[1].revents != 0) return;
      signalfd_siginfo info;
      if (read(signal_fd_, &info, sizeof info) == sizeof info) on_signal();
    }
  });
}

ShutdownWatcher::~ShutdownWatcher() {
  const std::uint64_t one = 1;
  DBR_CHECK(write(stop_fd_, &one, sizeof one) == sizeof one);
  thread_.join();
  close(signal_fd_);
  close(stop_fd_);
}

}  // namespace dbr
