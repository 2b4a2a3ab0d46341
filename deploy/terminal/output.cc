#include "deploy/terminal/output.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <climits>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/monotonic_clock.h"
#include "core/shutdown.h"

namespace dbr {

namespace {

// Opens a terminal or a pipe anew, so that no write to it blocks: one that is ready may still take only a
// part of a text. The flag of `fd` itself is shared with other programs, the shell among them. -1 for other
// files, and where it may not be opened.
int OpenWithoutBlocking(int fd) {
  struct stat found;
  if (fstat(fd, &found) != 0 || !(S_ISCHR(found.st_mode) || S_ISFIFO(found.st_mode))) return -1;
  return open(absl::StrCat("/proc/self/fd/", fd).c_str(), O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
}

}  // namespace

Output::Output(int fd) : fd_(fd), write_fd_(OpenWithoutBlocking(fd)), stop_fd_(eventfd(0, EFD_CLOEXEC)) {
  DBR_CHECK(stop_fd_ >= 0);
  thread_ = ThreadWithoutSignals([this] { Run(); });
}

Output::~Output() {
  {
    absl::MutexLock lock(&mutex_);
    AwaitFor(&mutex_, absl::Condition(this, &Output::AllWritten), kPatience);
    stopping_ = true;
  }
  const std::uint64_t one = 1;
  DBR_CHECK(write(stop_fd_, &one, sizeof one) == sizeof one);
  thread_.join();
  close(stop_fd_);
  if (write_fd_ >= 0) close(write_fd_);
}

void Output::Write(absl::string_view text) {
  absl::MutexLock lock(&mutex_);
  if (pending_.size() + text.size() > kMostBytes) {
    ++dropped_;
    return;
  }
  TellOfDropped();
  absl::StrAppend(&pending_, text);
}

void Output::TellOfDropped() {
  if (dropped_ > 0) absl::StrAppend(&pending_, "[", dropped_, " messages are left out: nobody read them]\n");
  dropped_ = 0;
}

bool Output::behind() const {
  absl::MutexLock lock(&mutex_);
  return pending_.size() > PIPE_BUF;
}

void Output::Run() {
  absl::MutexLock lock(&mutex_);
  for (;;) {
    mutex_.Await(absl::Condition(this, &Output::HasWork));
    if (stopping_) return;
    // What was taken counts as pending until it is written, so that behind() tells of it.
    const std::string piece = pending_.substr(0, PIPE_BUF);
    mutex_.Unlock();
    const bool written = WritePiece(piece);
    mutex_.Lock();
    pending_.erase(0, written || stopping_ ? piece.size() : pending_.size());
    if (pending_.empty()) TellOfDropped();
  }
}

bool Output::WritePiece(absl::string_view piece) {
  const int fd = write_fd_ >= 0 ? write_fd_ : fd_;
  while (!piece.empty()) {
    pollfd fds[2] = {{fd, POLLOUT, 0}, {stop_fd_, POLLIN, 0}};
    if (poll(fds, 2, -1) < 0) continue;
    if (fds[1].revents != 0) return false;
    const ssize_t n = write(fd, piece.data(), piece.size());
    if (n < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (n < 0) return false;
    piece.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

}  // namespace dbr
