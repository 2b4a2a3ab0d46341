// The learner's checkpoints: whole files, the newest few of them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/safetensors.h"

namespace dbr {

// Files named UPDATES.safetensors (12 digits) in a folder, which docs/formats.md describes. One thread at a
// time.
class Checkpoints {
 public:
  // Keeps the newest `keep` files (at least 1).
  Checkpoints(std::string folder, int keep) : folder_(std::move(folder)), keep_(keep) {}

  // Writes atomically (core/file_io.h), then removes the oldest files past `keep`. Creates the folder. Errors
  // are those of SaveTensors (core/safetensors.h); nothing is removed then.
  absl::Status Save(std::uint64_t updates, const TensorFile& file);

  // What LoadNewest found.
  struct Loaded {
    TensorFile file;
    std::string path;
    std::vector<std::string> refused;  // newer files that are damaged, each with what is wrong with it
  };
  // The newest file that is whole. NotFound where the folder has none; DataLoss, naming each, where all are
  // damaged.
  absl::StatusOr<Loaded> LoadNewest() const;

 private:
  std::vector<std::string> Newest() const;  // paths, newest first

  const std::string folder_;
  const int keep_;
};

}  // namespace dbr
