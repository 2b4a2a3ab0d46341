// The grid that a report is made over, and the questions the report has about it.
#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "proto/experiment.pb.h"

namespace dbr::report {

// Adds the tasks, contenders and scales that `grid` lacks, by name.
void AddMissing(const Experiment& other, Experiment* grid);

// Seeds of each cell at that scale; 0 where the grid has no such scale.
int SeedsAt(const Experiment& grid, absl::string_view scale);

// The rows of a task: its measures, each with a label; one of the mean return where it names none.
std::vector<Measure> MeasuresOf(const Task& task);

std::string LabelOf(const Task& task);
std::string LabelOf(const Contender& contender);

// Indices of the contenders that are no ablations; of `base` and of its ablations, `base` first.
std::vector<int> Columns(const Experiment& grid);
std::vector<int> WithAblations(const Experiment& grid, int base);

}  // namespace dbr::report
