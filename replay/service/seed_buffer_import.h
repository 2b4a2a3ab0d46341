// Loading the seed buffer: offline data from a file, which a replay buffer begins with.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/transition.h"
#include "replay/buffer/partitioned_buffer.h"
#include "replay/store/seed_buffer_record.h"

namespace dbr {

struct SeedBufferOptions {
  std::string path;            // HDF5 file, or folder of a Minari dataset; empty: none
  std::string layout;          // of replay/dataset/dataset_layout.h; empty: as the file's own attribute says
  std::string env;             // name of the environment that the data must come from
  float discount = 0.99f;      // of a step after which the task goes on
  int n_step = 1;              // steps of a transition, at least 1
  bool evict = false;          // let the seed buffer's rows make room as others do
  bool skip_bad_rows = false;  // else a bad row (replay/dataset/dataset_reader.h) is an error
  // Rows that the file must have at least; other than 0 where the first draw will wait for so many while
  // there is nothing but the seed buffer.
  std::uint64_t min_rows = 0;
  bool others_will_come = true;  // then a seed buffer that is never evicted must leave room for others
  // Both functions below return Cancelled soon after this becomes true. Outlives the call; null: never.
  const std::atomic<bool>* cancelled = nullptr;
};

// Checks that the file is data of that environment and fits a buffer of `capacity` rows. Opens it and counts
// its transitions without reading them. Errors are ImportSeedBuffer's, but those of bad rows.
absl::Status CheckSeedBufferFits(const SeedBufferOptions& options, const TransitionLayout& layout,
                                 std::uint64_t capacity);

// Reads the whole file into `buffer`, in the file's order, and completes the seed buffer. Goes on where an
// import into the same store was broken off, and does nothing where the store has its seed buffer already.
// Returns the record of the seed buffer. Where the buffer's rows have a return it is computed here; behind an
// end that is cut or unfinished, the mean reward of the last min(T, 1 / (1 - discount)) steps is taken to go
// on for ever (replay/dataset/return_reader.h). With n_step > 1 the file's steps become as many transitions
// of up to n_step steps (replay/dataset/n_step_rows.h). Errors: InvalidArgument for a seed buffer that does
// not fit the capacity or the environment, Cancelled (what was read stays in the buffer), and all errors of
// DatasetReader and PartitionedBuffer::InsertSeedBuffer. Blocks: it loads some 10^6 rows a second.
absl::StatusOr<SeedBufferRecord> ImportSeedBuffer(const SeedBufferOptions& options,
                                                  PartitionedBuffer* buffer);

}  // namespace dbr
