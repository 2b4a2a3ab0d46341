// The check of rows on their way into the replay buffer.
#pragma once

#include <vector>

#include "core/transition.h"
#include "replay/buffer/columns.h"

namespace dbr {

// Returns [count], true for each row that the buffer refuses: with a NaN or an infinity in a column, with an
// infinite advantage, or with a discrete action that is not one of 0 ... mask width - 1. Returns an empty
// vector, without allocating, where there is no such row. Free of state, for any thread. O(floats).
std::vector<bool> RefusedRows(const TransitionLayout& layout, const InsertColumns& columns);

}  // namespace dbr
