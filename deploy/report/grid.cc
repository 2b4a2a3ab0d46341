#include "deploy/report/grid.h"

#include <algorithm>

namespace dbr::report {
namespace {

// Appends to `mine` each of `theirs` whose name none of `mine` has.
template <class Named>
void AddByName(const google::protobuf::RepeatedPtrField<Named>& theirs,
               google::protobuf::RepeatedPtrField<Named>* mine) {
  for (const Named& other : theirs) {
    const auto same = [&other](const Named& one) { return one.name() == other.name(); };
    if (std::none_of(mine->begin(), mine->end(), same)) *mine->Add() = other;
  }
}

}  // namespace

void AddMissing(const Experiment& other, Experiment* grid) {
  AddByName(other.task(), grid->mutable_task());
  AddByName(other.contender(), grid->mutable_contender());
  AddByName(other.scale(), grid->mutable_scale());
}

int SeedsAt(const Experiment& grid, absl::string_view scale) {
  for (const Scale& one : grid.scale()) {
    if (one.name() == scale) return static_cast<int>(one.seeds());
  }
  return 0;
}

std::vector<Measure> MeasuresOf(const Task& task) {
  std::vector<Measure> measures(task.measure().begin(), task.measure().end());
  if (measures.empty()) measures.emplace_back();
  for (Measure& measure : measures) {
    if (measure.label().empty()) measure.set_label(LabelOf(task));
  }
  return measures;
}

std::string LabelOf(const Task& task) {
  return task.label().empty() ? task.name() : task.label();
}

std::string LabelOf(const Contender& contender) {
  return contender.label().empty() ? contender.name() : contender.label();
}

std::vector<int> Columns(const Experiment& grid) {
  std::vector<int> columns;
  for (int i = 0; i < grid.contender_size(); ++i) {
    if (grid.contender(i).ablation_of().empty()) columns.push_back(i);
  }
  return columns;
}

std::vector<int> WithAblations(const Experiment& grid, int base) {
  std::vector<int> family = {base};
  for (int i = 0; i < grid.contender_size(); ++i) {
    if (grid.contender(i).ablation_of() == grid.contender(base).name()) family.push_back(i);
  }
  return family;
}

}  // namespace dbr::report
