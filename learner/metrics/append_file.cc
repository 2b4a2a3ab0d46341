#include "learner/metrics/append_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "core/file_io.h"

namespace dbr {

absl::StatusOr<std::unique_ptr<AppendFile>> AppendFile::Open(const std::string& path) {
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) return ErrnoStatus(errno, "cannot open", path);
  const off_t size = lseek(fd, 0, SEEK_END);
  if (size < 0) {
    const int error_number = errno;
    close(fd);
    return ErrnoStatus(error_number, "cannot find the end of", path);
  }
  return std::unique_ptr<AppendFile>(new AppendFile(path, fd, size));
}

AppendFile::~AppendFile() {
  close(fd_);
}

absl::Status AppendFile::DropPartialLine() {
  constexpr long kMostBytes = 1 << 20;
  const long begin = std::max(0L, size_ - kMostBytes);
  std::string tail(static_cast<std::size_t>(size_ - begin), '\0');
  if (pread(fd_, tail.data(), tail.size(), begin) != static_cast<ssize_t>(tail.size())) {
    return ErrnoStatus(errno, "cannot read the end of", path_);
  }
  const auto last = tail.rfind('\n');
  const long end = last == std::string::npos ? begin : begin + static_cast<long>(last) + 1;
  if (end == size_) return absl::OkStatus();
  if (ftruncate(fd_, end) != 0) return ErrnoStatus(errno, "cannot cut", path_);
  size_ = end;
  return absl::OkStatus();
}

absl::Status AppendFile::Append(absl::string_view records) {
  long end = size_;
  while (!records.empty()) {
    const ssize_t n = pwrite(fd_, records.data(), records.size(), end);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      const absl::Status status = ErrnoStatus(errno, "cannot write", path_);
      // Where even this fails a reader may see a part of a record until the next write, which starts at size_
      // again.
      [[maybe_unused]] const int cut = ftruncate(fd_, size_);
      return status;
    }
    end += n;
    records.remove_prefix(static_cast<std::size_t>(n));
  }
  size_ = end;
  return absl::OkStatus();
}

}  // namespace dbr
