// Reads offline data from HDF5 files of any size, as transitions.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/transition.h"
#include "replay/dataset/dataset_facts.h"
#include "replay/dataset/dataset_layout.h"
#include "replay/dataset/transition_chunk.h"

namespace dbr {

struct DatasetOptions {
  std::optional<DatasetLayout> layout = std::nullopt;  // empty: as the file's own attribute `layout` says
  std::string env = "";      // environment whose data is expected, for messages; empty: any
  int observation_size = 0;  // expected; 0: any
  int action_width = 0;      // expected; 0: any
  float discount = 0.99f;    // of a transition after which the task goes on
  // d4rl_pybullet and d4rl without `timeouts`: an episode of that many steps is cut, not terminal. 0: as the
  // file's own attribute `max_episode_steps` says, else 1,000.
  int max_episode_steps = 0;
  // Leaves out every transition that takes a value from a bad row: one with a NaN or an infinity, or with a
  // flag that is neither 0 nor 1 (no episode ends there). Without it such a file is refused as soon as a bad
  // row is met.
  bool skip_bad_rows = false;
  // Open, Next and CountTransitions return Cancelled soon after this becomes true: before they read the next
  // few thousand rows or the next episode. Outlives the reader; null: never.
  const std::atomic<bool>* cancelled = nullptr;
};

// A stream of a file's transitions in the file's order. What has no next observation has no transition: in
// d4rl without `next_observations` the row at a time limit and an unfinished last row. A terminal row always
// has one, with discount 0. Memory does not grow with the file. One thread at a time; several readers may run
// on several threads.
class DatasetReader {
 public:
  // Opens and checks keys, shapes and sizes; reads no rows. `path` is an HDF5 file or the folder of a Minari
  // dataset. Errors name the file: NotFound, PermissionDenied, DataLoss (no HDF5 file, or a truncated one),
  // InvalidArgument (no regular file, no layout named, one that contradicts the file's own word, a missing
  // key or one that tells of ends in another way, arrays of different lengths, sizes of another robot),
  // FailedPrecondition (open for writing elsewhere, a missing filter, a newer HDF5), Cancelled. O(episodes)
  // in layout minari.
  static absl::StatusOr<std::unique_ptr<DatasetReader>> Open(const std::string& path,
                                                             const DatasetOptions& options);
  ~DatasetReader();
  DatasetReader(const DatasetReader&) = delete;
  DatasetReader& operator=(const DatasetReader&) = delete;

  DatasetLayout layout() const;
  // Sizes as the file has them; mask_width is 0.
  const TransitionLayout& transition_layout() const;
  // The HDF5 file that is read.
  const std::string& path() const;
  // The file's attribute `env`; empty where it has none.
  const std::string& env() const;
  int max_episode_steps() const;

  // Refills `chunk`, made with transition_layout(), and returns chunk->size: less than its capacity only at
  // the end of the file, and 0 from then on. Errors: InvalidArgument for a bad row (its
  // number, and how many there are; options.skip_bad_rows would drop them), DataLoss where the file cannot
  // be read. After an error the same error again. Reads from disk.
  absl::StatusOr<int> Next(TransitionChunk* chunk);

  // How many transitions Next will hand out where no row is bad. Reads the flags of all rows, nothing else;
  // does not move the stream.
  absl::StatusOr<std::int64_t> CountTransitions();

  // The facts of what was read so far; they are complete after Next gave 0. `rows` is right from the start.
  const DatasetFacts& facts() const;

 private:
  struct State;
  explicit DatasetReader(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

}  // namespace dbr
