// Making a grid of runs of which it is known that it makes sense.
#pragma once

#include "absl/status/statusor.h"
#include "deploy/experiment/grid.h"
#include "proto/experiment.pb.h"

namespace dbr {

// The grid with the cells that options.only chooses, at the scale that options.scale names (empty: the
// first). InvalidArgument lists ALL that is wrong, a line each:
//
// - with the grid: names given twice or that can name no folder, globs of contenders that match no task, an
//   `ablation_of` or a published figure that names nobody, a grid without tasks, contenders or scales;
// - with the options: an unknown scale, globs that no cell answers to;
// - with a pair of task and contender: an environment that there is not, what does not fit it (CheckFits), an
//   offline task that would start actors, a run without an end, a row of the report against an opponent that
//   the final evaluation does not meet;
// - with the chosen cells: folders whose sockets' paths would be too long, and seed buffers that are not
//   there and that a cell without a run to go on with needs, with the command that makes them.
//
// Reads the folders of cells whose seed buffer is missing.
absl::StatusOr<Grid> MakeCheckedGrid(const Experiment& experiment, const GridOptions& options);

}  // namespace dbr
