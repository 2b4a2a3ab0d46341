#include "replay/dataset/dataset_facts.h"

#include "absl/strings/str_cat.h"

namespace dbr {

std::vector<std::string> DataWarnings(const WarningCounts& counts) {
  std::vector<std::string> warnings;
  if (counts.transitions > 0 && counts.episodes == 0) {
    warnings.emplace_back(
        "no episode ends in the file: no flag is 1, as if all rows were one episode without an end. Are the "
        "ends lost, or under another key?");
  }
  if (counts.actions_outside > 0) {
    warnings.push_back(absl::StrCat(counts.actions_outside,
                                    " rows have actions outside [-1, 1], the range of the environments; they "
                                    "are taken as they are. Were ",
                                    "they recorded with other bounds?"));
  }
  return warnings;
}

std::vector<std::string> WarningsOf(const DatasetFacts& facts) {
  return DataWarnings({.transitions = static_cast<std::uint64_t>(facts.transitions),
                       .episodes = static_cast<std::uint64_t>(facts.episodes),
                       .actions_outside = static_cast<std::uint64_t>(facts.actions_outside)});
}

}  // namespace dbr
