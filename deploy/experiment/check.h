// Whether a grid of runs makes sense: everything that is wrong with it, a line each.
#pragma once

#include <string>
#include <vector>

#include "deploy/experiment/grid.h"
#include "proto/experiment.pb.h"

namespace dbr {

// Of the grid itself: names given twice or that can name no folder, globs of contenders that match no task,
// an `ablation_of` or a published figure that names nobody, a grid without tasks, contenders or scales.
std::vector<std::string> FindGridErrors(const Experiment& experiment);

// Appends what is wrong with pairs of task and contender: an environment that there is not, what does not fit
// it (CheckFits), an offline task that would start actors, a run without an end, a row of the report against
// an opponent that the final evaluation does not meet. One cell for each pair.
void FindPairErrors(const Experiment& experiment, const std::vector<Cell>& first_cells,
                    std::vector<std::string>* errors);

// Appends what is wrong with the chosen cells: folders whose sockets' paths would be too long, and, of those
// with no run that could go on, seed buffers that are not there, with the command that makes them.
void FindCellErrors(const Experiment& experiment, const std::vector<Cell>& cells,
                    std::vector<std::string>* errors);

}  // namespace dbr
