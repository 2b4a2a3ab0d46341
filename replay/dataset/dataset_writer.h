// Writes offline data as HDF5 files, episode by episode.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/space.h"
#include "replay/dataset/dataset_layout.h"
#include "replay/dataset/episode.h"

namespace dbr {

struct DatasetWriterOptions {
  DatasetLayout layout = DatasetLayout::kD4rl;  // kD4rl or kD4rlPybullet
  EnvSpec env;                                  // sizes; name and max_episode_steps go into attributes
  int compression = 1;                          // gzip's level, 0 (none) to 9
};

// Appends to chunked, compressed arrays of float32 in a temporary file beside `path`, which Finish gives that
// name; without Finish the destructor removes it. d4rl files have `next_observations` and `timeouts`.
// d4rl_pybullet files have their recipe's keys, where a time limit is a terminal too, and `timeouts` beside
// them, so that nothing is lost. One thread at a time.
class DatasetWriter {
 public:
  // InvalidArgument for layout minari or a discrete space; NotFound, PermissionDenied or Internal with the
  // path.
  static absl::StatusOr<std::unique_ptr<DatasetWriter>> Create(const std::string& path,
                                                               const DatasetWriterOptions& options);
  ~DatasetWriter();
  DatasetWriter(const DatasetWriter&) = delete;
  DatasetWriter& operator=(const DatasetWriter&) = delete;

  // Requires the environment's sizes (CHECKed). An unfinished episode that another one follows is marked as
  // cut there, for its last step must not seem to lead into the next episode. ResourceExhausted or Internal
  // where the disk does not take it.
  absl::Status Append(const EpisodeView& episode);

  // Writes the rest, closes the file and gives it its name. Nothing may follow. ResourceExhausted or
  // Internal.
  absl::Status Finish();

 private:
  struct State;
  explicit DatasetWriter(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

}  // namespace dbr
