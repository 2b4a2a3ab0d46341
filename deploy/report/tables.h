// The parts of a report that are tables and lists.
#pragma once

#include <vector>

#include "deploy/report/cells.h"
#include "deploy/report/document.h"
#include "deploy/report/scores.h"

namespace dbr::report {

// What was published and what our runs came to, a group of lines for each row; the best of ours in bold.
void AddResults(const Runs& runs, const std::vector<Row>& rows, Document* document);

// The same for a contender and its ablations, over the rows that one of them takes part in.
void AddAblationTable(const Runs& runs, const std::vector<Row>& rows, const std::vector<int>& family,
                      Document* document);

// Each cell: state, commit, time, updates, steps, how it ended, its config's digest, the kernels of its
// learner; and why cells failed.
void AddCells(const Runs& runs, Document* document);

// What the config of each task and contender sets.
void AddSettings(const Runs& runs, Document* document);

}  // namespace dbr::report
