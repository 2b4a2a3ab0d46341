// Offline data with the Monte-Carlo returns of its episodes.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/transition.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/dataset/transition_chunk.h"

namespace dbr {

// Hands out a reader's transitions stretch by stretch: a whole episode, or what lies between two gaps of one
// (rows that were left out as bad, and what has no next observation). The return of a stretch that ends in no
// terminal goes on behind its end as StationaryContinuation (core/returns.h) estimates, for there is no
// critic to ask. Where a file of layout d4rl has no `next_observations`, the reward of the row at a time
// limit is no transition's and does not count. Holds one stretch in memory. One thread at a time.
class ReturnReader {
 public:
  // `reader`, from which nothing was read, outlives this. Requires 0 <= discount < 1, the discount that the
  // reader was opened with.
  ReturnReader(DatasetReader* reader, float discount);

  // The reader's layout with a return.
  const TransitionLayout& layout() const { return layout_; }

  // The rows [T x stride] of the next stretch, as layout() lays them; empty at the end. They are valid until
  // the next call. Errors are DatasetReader::Next's. Reads from disk.
  absl::StatusOr<absl::Span<const float>> Next();

 private:
  DatasetReader* const reader_;
  const double discount_;
  const TransitionLayout layout_;
  TransitionChunk chunk_;    // without returns
  int next_ = 0;             // of its rows
  std::vector<float> rows_;  // of the stretch
};

}  // namespace dbr
