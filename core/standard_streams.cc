#include "core/standard_streams.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace dbr {
namespace {

bool IsOpen(int fd) {
  return fcntl(fd, F_GETFD) != -1 || errno != EBADF;
}

// Opening takes the lowest number that is free, which is `fd`'s if it is closed and those below are not.
void Hold(int fd, int flags) {
  if (!IsOpen(fd)) [[maybe_unused]]
    const int held = open("/dev/null", flags);
}

// Whether nobody can read any more what is written to the pipe or socket.
bool ReaderGone(int fd) {
  pollfd state = {fd, POLLOUT, 0};
  return poll(&state, 1, 0) == 1 && (state.revents & POLLERR) != 0;
}

}  // namespace

void HoldStandardStreams() {
  Hold(STDIN_FILENO, O_RDONLY);
  Hold(STDOUT_FILENO, O_RDONLY);  // so that writing is an error and not success
  Hold(STDERR_FILENO, O_WRONLY);
}

std::string LostOutput(bool* reader_gone) {
  *reader_gone = false;
  const bool failed_before = std::ferror(stdout) != 0;
  errno = 0;
  bool failed = std::fflush(stdout) != 0;
  // Some network file systems say only when a file is closed that it is full.
  if (!failed) {
    const int copy = dup(STDOUT_FILENO);
    failed = copy < 0 || close(copy) != 0;
  }
  const int reason = failed ? errno : 0;
  if (!failed && !failed_before) return "";
  *reader_gone = reason == EPIPE || ReaderGone(STDOUT_FILENO);
  return reason != 0 ? std::strerror(reason) : "an earlier write failed";
}

}  // namespace dbr
