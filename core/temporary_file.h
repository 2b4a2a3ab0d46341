// A file that takes another's place when it is whole.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace dbr {

// A file beside `path` that becomes `path` in one step, or is removed. A process that is killed cannot remove
// its file: whoever makes the next one in that folder does. A lock on the open file, which the kernel takes
// back when its process ends, is the sign of life. So neither a process id that was given away again nor a
// process on another machine that shares the disk is taken for a dead one; and where the disk knows no locks,
// nothing is removed. Files of other users and those with other names are never touched. One thread.
class TemporaryFile {
 public:
  // Makes an empty file, which the umask alone hides from others. Its name is short and has nothing of
  // `path`'s, which may be as long as the file system allows. Errors name `path`: NotFound where there is no
  // such folder, PermissionDenied, ResourceExhausted. Reads the folder.
  static absl::StatusOr<std::unique_ptr<TemporaryFile>> Create(const std::string& path);
  // Removes the file unless it was committed.
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  // For writing.
  int fd() const { return fd_; }
  // The path of the temporary, for a library that opens files by themselves.
  const std::string& name() const { return name_; }

  // Brings the contents to disk and renames the file to `path`. Errors name `path`.
  absl::Status Commit();

 private:
  TemporaryFile(std::string path, std::string name, int fd)
      : path_(std::move(path)), name_(std::move(name)), fd_(fd) {}

  const std::string path_;
  const std::string name_;
  const int fd_;
  bool committed_ = false;
};

}  // namespace dbr
