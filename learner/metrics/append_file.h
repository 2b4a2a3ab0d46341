// A file that only grows, by whole records.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// A file open for writing at its end. One thread at a time. Nobody else may write to the file meanwhile.
class AppendFile {
 public:
  // Opens or creates `path` and positions at its end. Errors name the path: NotFound where its folder is
  // missing, PermissionDenied, ResourceExhausted, Internal.
  static absl::StatusOr<std::unique_ptr<AppendFile>> Open(const std::string& path);
  ~AppendFile();
  AppendFile(const AppendFile&) = delete;
  AppendFile& operator=(const AppendFile&) = delete;

  // Cuts off what follows the last line's end: the part of a row that a killed process left behind. Reads at
  // most the file's last 1 MiB. Errors as Open's.
  absl::Status DropPartialLine();

  // Writes all of `records` at the end, or nothing: a partial write (ResourceExhausted: the disk is full) is
  // cut off again.
  absl::Status Append(absl::string_view records);

 private:
  AppendFile(std::string path, int fd, long size) : path_(std::move(path)), fd_(fd), size_(size) {}

  const std::string path_;
  const int fd_;
  long size_;  // bytes of whole records
};

}  // namespace dbr
