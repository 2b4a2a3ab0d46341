// Which transitions the replay refuses.
#pragma once

#include <vector>

#include "core/transition.h"
#include "replay/buffer/columns.h"

namespace dbr {

// True for each row that has a NaN or an infinity in a column, an infinite advantage, or a discrete action
// that is not one of the 0 ... mask width - 1; empty where there is no such row. O(values).
std::vector<bool> RefusedRows(const TransitionLayout& layout, const InsertColumns& columns);

}  // namespace dbr
