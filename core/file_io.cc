#include "core/file_io.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <memory>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/shutdown.h"
#include "core/status_macros.h"
#include "core/temporary_file.h"

namespace dbr {
namespace {

constexpr std::size_t kMaxFileBytes = std::size_t{4} << 30;
constexpr std::size_t kMaxTextBytes = std::size_t{16} << 20;

absl::Status WriteAll(int fd, absl::string_view contents, const std::string& path) {
  while (!contents.empty()) {
    const ssize_t n = write(fd, contents.data(), contents.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return ErrnoStatus(errno, "cannot write", path);
    contents.remove_prefix(static_cast<std::size_t>(n));
  }
  return absl::OkStatus();
}

std::string KindOf(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

// Reads to the end. `await` is called before each read, which then does not block. InvalidArgument where
// there is more than `limit` bytes, of which no more are read.
template <typename Await>
absl::StatusOr<std::string> ReadAtMost(int fd, std::size_t limit, const std::string& path, Await await) {
  std::string contents;
  std::array<char, 1 << 16> buffer;
  for (;;) {
    RETURN_IF_ERROR(await());
    const ssize_t n = read(fd, buffer.data(), buffer.size());
    if (n < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (n < 0) return ErrnoStatus(errno, "cannot read", path);
    if (n == 0) return contents;
    contents.append(buffer.data(), static_cast<std::size_t>(n));
    if (contents.size() > limit) {
      return absl::InvalidArgumentError(absl::StrCat(path, ": expected at most ", limit >> 20,
                                                     " MiB, found more; is it the file that you meant?"));
    }
  }
}

// Waits until `fd` has something to be read or its other end was closed. A pipe that nobody has opened for
// writing yet has neither. Cancelled where `signals` can be read from.
absl::Status AwaitInput(int fd, int signals, const std::string& path) {
  std::array<pollfd, 2> waiting = {{{fd, POLLIN, 0}, {signals, POLLIN, 0}}};
  while (poll(waiting.data(), waiting.size(), -1) < 0) {
    if (errno != EINTR) return ErrnoStatus(errno, "cannot wait for", path);
  }
  if (waiting[1].revents == 0) return absl::OkStatus();
  return absl::CancelledError(absl::StrCat(path, ": the reading was stopped by a signal"));
}

absl::StatusOr<std::string> WithoutByteOrderMark(std::string text, const std::string& path) {
  if (absl::StartsWith(text, "\xEF\xBB\xBF")) text.erase(0, 3);
  if (absl::StartsWith(text, "\xFF\xFE") || absl::StartsWith(text, "\xFE\xFF")) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": expected text in UTF-8, found UTF-16; save it as UTF-8"));
  }
  return text;
}

}  // namespace

absl::Status ErrnoStatus(int error_number, absl::string_view what, absl::string_view path) {
  const std::string message = absl::StrCat(what, " ", path, ": ", std::strerror(error_number));
  switch (error_number) {
    case ENOENT:
    case ENOTDIR:
      return absl::NotFoundError(message);
    case EACCES:
    case EPERM:
    case EROFS:
      return absl::PermissionDeniedError(message);
    case ENOSPC:
    case EDQUOT:
      return absl::ResourceExhaustedError(
          absl::StrCat(message, ". Free some space or choose another folder."));
    case EFBIG:
      return absl::ResourceExhaustedError(
          absl::StrCat(message, ". Raise the limit of `ulimit -f`, or choose another disk."));
    default:
      return absl::InternalError(message);
  }
}

absl::Status WriteFileAtomically(const std::string& path, absl::string_view contents) {
  ASSIGN_OR_RETURN(const std::unique_ptr<TemporaryFile> file, TemporaryFile::Create(path));
  RETURN_IF_ERROR(WriteAll(file->fd(), contents, path));
  return file->Commit();
}

absl::Status CheckRegularFile(int fd, absl::string_view path) {
  struct stat found = {};
  if (fstat(fd, &found) != 0) return ErrnoStatus(errno, "cannot read", path);
  if (S_ISREG(found.st_mode)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": expected a file, found ", KindOf(found.st_mode), "; name a file"));
}

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return ErrnoStatus(errno, "cannot open", path);
  const absl::Cleanup close_file = [fd] { close(fd); };
  RETURN_IF_ERROR(CheckRegularFile(fd, path));
  return ReadAtMost(fd, kMaxFileBytes, path, [] { return absl::OkStatus(); });
}

absl::StatusOr<std::string> ReadTextFile(const std::string& path) {
  // Without O_NONBLOCK this would wait, deaf to signals, until somebody opens the other end of a pipe.
  const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return ErrnoStatus(errno, "cannot open", path);
  const absl::Cleanup close_file = [fd] { close(fd); };
  struct stat found = {};
  if (fstat(fd, &found) != 0) return ErrnoStatus(errno, "cannot read", path);
  if (!S_ISFIFO(found.st_mode)) RETURN_IF_ERROR(CheckRegularFile(fd, path));
  const int signals = OpenShutdownSignals();
  if (signals < 0) return ErrnoStatus(errno, "cannot wait for", path);
  const absl::Cleanup close_signals = [signals] { close(signals); };
  ASSIGN_OR_RETURN(std::string text,
                   ReadAtMost(fd, kMaxTextBytes, path, [&] { return AwaitInput(fd, signals, path); }));
  return WithoutByteOrderMark(std::move(text), path);
}

}  // namespace dbr
