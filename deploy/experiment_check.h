// Whether a grid of runs makes sense: everything that is wrong with it, a line each.
#pragma once

#include <string>
#include <vector>

#include "deploy/experiment_grid.h"
#include "proto/experiment.pb.h"

namespace dbr {

// Of the grid itself: names given twice or that can name no folder, globs of contenders that match no task,
// an `ablation_of` that names nobody, a grid without tasks, contenders or scales.
std::vector<std::string> FindGridErrors(const Experiment& experiment);

// Appends what is wrong with pairs of task and contender: an environment that there is not, an algorithm that
// does not serve its actions, an offline task that would start actors, a run without an end. One cell for
// each pair.
void FindPairErrors(const std::vector<Cell>& first_cells, std::vector<std::string>* errors);

// Appends what is wrong with the chosen cells: folders whose sockets' paths would be too long, and, of those
// that have not begun, seed buffers that are not there, with the command that makes them.
void FindCellErrors(const Experiment& experiment, const std::vector<Cell>& cells,
                    std::vector<std::string>* errors);

}  // namespace dbr
