// Loading offline data from a file into a buffer that begins with it.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/transition.h"
#include "replay/buffer/partitioned_buffer.h"
#include "replay/store/seed_buffer_record.h"

namespace dbr {

struct SeedBufferOptions {
  std::string path;            // HDF5 file; empty: none
  std::string layout;          // of replay/dataset/dataset_layout.h; empty: as the file's own attribute says
  std::string env;             // whose data is expected
  float discount = 0.99f;      // of transitions after which the task goes on
  bool evict = false;          // let the seed buffer's rows make room as others do
  bool skip_bad_rows = false;  // else a row with a value that is not finite is an error
  std::uint64_t min_rows =
      0;  // what the first draw waits for, where there will be nothing but the seed buffer
  bool others_will_come = true;  // then a seed buffer that is never evicted must leave room
};

// Opens the file and counts its transitions, without reading them: whether it is data of such an environment
// that fits a buffer of `capacity`. Errors as ImportSeedBuffer's, but those of bad rows.
absl::Status CheckSeedBufferFits(const SeedBufferOptions& options, const TransitionLayout& layout,
                                 std::uint64_t capacity);

// Reads the whole file into `buffer`, all in its order, and completes its seed buffer; goes on where an
// import into the same store was broken off, and does nothing where the store has its seed buffer already.
// Returns what the buffer then knows. Where the buffer's rows have a return it is computed here; behind an
// end that is cut or unfinished the mean reward of the last min(T, 1 / (1 - discount)) steps is taken to go
// on for ever (replay/dataset/return_reader.h). Errors: InvalidArgument for a seed buffer that does not fit
// the capacity or the environment, and all errors of DatasetReader and PartitionedBuffer::InsertSeedBuffer.
// Blocks: some 10^6 rows a second.
absl::StatusOr<SeedBufferRecord> ImportSeedBuffer(const SeedBufferOptions& options,
                                                  PartitionedBuffer* buffer);

}  // namespace dbr
