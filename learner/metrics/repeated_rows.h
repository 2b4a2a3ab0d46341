// What a new session repeats of a run's earlier rows for TensorBoard.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "learner/metrics/append_file.h"

namespace dbr {

// TensorBoard drops by the step alone what a SessionStartRecord of `step` leaves behind, but a run has two
// kinds of steps. Appends to `events`, from the rows of metrics.jsonl at `path` and with their own steps and
// times, what was dropped and still holds: the rows that count transitions (those with tags::kTransitions) at
// `step` or later, for the replay server goes on where it was, and the rows that count updates at `step`
// itself, for the learner has these updates. Lines that are no rows are passed over. O(size of the file).
// NotFound where there is none; other errors are those of AppendFile.
absl::Status RepeatWhatHolds(const std::string& path, std::int64_t step, AppendFile* events);

}  // namespace dbr
