#include "deploy/terminal/output.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <climits>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/monotonic_clock.h"
#include "core/shutdown.h"

namespace dbr {

Output::Output(int fd) : fd_(fd), stop_fd_(eventfd(0, EFD_CLOEXEC)) {
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
}

void Output::Write(absl::string_view text) {
  absl::MutexLock lock(&mutex_);
  if (pending_.size() + text.size() > kMostBytes) {
    ++dropped_;
    return;
  }
  if (dropped_ > 0) absl::StrAppend(&pending_, "[", dropped_, " messages are left out: nobody read them]\n");
  dropped_ = 0;
  absl::StrAppend(&pending_, text);
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
    // A pipe that is ready takes PIPE_BUF bytes without blocking. What was taken counts as pending until it
    // is written, so that behind() tells of it.
    const std::string piece = pending_.substr(0, PIPE_BUF);
    mutex_.Unlock();
    const bool written = WritePiece(piece);
    mutex_.Lock();
    pending_.erase(0, written || stopping_ ? piece.size() : pending_.size());
  }
}

bool Output::WritePiece(absl::string_view piece) {
  while (!piece.empty()) {
    pollfd fds[2] = {{fd_, POLLOUT, 0}, {stop_fd_, POLLIN, 0}};
    if (poll(fds, 2, -1) < 0) continue;
    if (fds[1].revents != 0) return false;
    const ssize_t n = write(fd_, piece.data(), piece.size());
    if (n < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (n < 0) return false;
    piece.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

}  // namespace dbr
