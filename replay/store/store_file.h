// The memory under the store: a mapped file with a checked header, or memory alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/transition.h"

namespace dbr {

// What the contents of a store's file mean. It stands in the file's header; a file with another one is
// refused.
struct StoreShape {
  std::string env;  // name of the environment, at most 63 bytes
  TransitionLayout layout;
  std::uint64_t capacity = 0;     // rows
  std::uint64_t total_bytes = 0;  // size of the file, its header included
};

// A mapping of `total_bytes`:
//
//   | header, kHeaderBytes | contents: of the user, zero in a fresh file |
//     magic, format,         ^ contents()
//     shape, CRC-32C
//
// The file's pages belong to the system: what was written to them outlives a kill of the process (not a loss
// of power; Sync is for that). A file is locked against a second process as long as it is mapped. Unmapped by
// the destructor. Thread-compatible.
class StoreFile {
 public:
  static constexpr std::size_t kHeaderBytes = 4096;

  // An empty path maps memory alone. Without `resume` the file must not exist, and its whole size is reserved
  // on disk before it takes its name: a full disk is ResourceExhausted here and no fault later. With it the
  // file must be there and have the same shape. Errors: AlreadyExists, NotFound, FailedPrecondition (another
  // shape, or in use), DataLoss (truncated or damaged), ResourceExhausted, PermissionDenied, InvalidArgument
  // (the environment's name).
  static absl::StatusOr<std::unique_ptr<StoreFile>> Open(const std::string& path, const StoreShape& shape,
                                                         bool resume);
  ~StoreFile();
  StoreFile(const StoreFile&) = delete;
  StoreFile& operator=(const StoreFile&) = delete;

  std::byte* contents() const { return map_ + kHeaderBytes; }

  // Writes all to disk; blocks until it is there. Does nothing for memory alone. Errors are the system's,
  // with the path.
  absl::Status Sync();

 private:
  StoreFile(std::string path, int fd, std::byte* map, std::size_t bytes)
      : path_(std::move(path)), fd_(fd), map_(map), bytes_(bytes) {}

  const std::string path_;
  const int fd_;  // -1: memory alone
  std::byte* const map_;
  const std::size_t bytes_;
};

}  // namespace dbr
