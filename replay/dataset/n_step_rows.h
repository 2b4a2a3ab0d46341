// n-step transitions of offline data.
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "core/n_step.h"
#include "core/transition.h"

namespace dbr {

// Takes a file's single steps as rows, in their order, and makes as many rows of n-step transitions of them
// (NStepAccumulator). A transition never crosses the end of an episode, a gap of rows that were left out, or
// a row whose observation is another than the next observation of the row before: a file with
// `next_observations` may have such breaks where nothing else tells of an end. One thread at a time.
class NStepRows {
 public:
  // Requires n > 1.
  NStepRows(const TransitionLayout& layout, int n);

  // Takes the next step, a row as the layout lays it. `starts`: it does not follow the one before it.
  void Add(const float* row, bool starts);
  // Takes the end of the file: what still waits gets no further steps.
  void Finish();

  // The rows [k x stride] that were made since the last Clear(). They are valid until the next call of the
  // other functions.
  absl::Span<const float> rows() const { return rows_; }
  void Clear() { rows_.clear(); }

 private:
  bool Follows(const float* row) const;
  absl::Status Append(const TransitionView& transition);  // always OK

  const TransitionLayout layout_;
  NStepAccumulator steps_;
  std::vector<float> rows_;
};

}  // namespace dbr
