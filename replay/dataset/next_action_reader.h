// Offline data with what was done at each next state.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/transition.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/dataset/transition_chunk.h"

namespace dbr {

// Hands out a reader's transitions, each with the action of the transition that follows it, or with zeros
// after a true terminal. Where nothing follows (a cut episode, a gap of rows that were left out, a row whose
// observation is another than the next observation before it, the end of the file) the file cannot say what
// would have been done: that transition is left out. Holds one chunk in memory. One thread at a time.
class NextActionReader {
 public:
  // `reader`, from which nothing was read, outlives this.
  explicit NextActionReader(DatasetReader* reader);

  // The reader's layout with a next action.
  const TransitionLayout& layout() const { return layout_; }

  // The next rows [n x stride], as layout() lays them; empty at the end. They are valid until the next call.
  // Errors are DatasetReader::Next's. Reads from disk.
  absl::StatusOr<absl::Span<const float>> Next();
  // Whether row i of the newest Next() does not follow the row before it.
  bool Starts(std::size_t i) const { return starts_[i] != 0; }

 private:
  // Takes row i of the chunk, which tells what was done after the row that waits.
  void Take(int i);
  // Whether `row` goes on where the row that waits ends: a file may have breaks that nothing else tells of.
  bool Follows(const TransitionView& row) const;
  // Ends the row that waits, which nothing follows.
  void EndWaiting();
  void KeepWaiting(absl::Span<const float> next_action);

  DatasetReader* const reader_;
  const TransitionLayout layout_;
  TransitionChunk chunk_;             // without next actions
  std::vector<float> waiting_;        // [stride] the newest row, as layout_ lays it
  bool waits_ = false;                // whether there is one
  bool waiting_starts_ = false;       // whether it starts a stretch
  std::vector<float> rows_;           // of the newest Next()
  std::vector<std::uint8_t> starts_;  // of these rows
  const std::vector<float> nothing_;  // [action width] zeros
};

}  // namespace dbr
