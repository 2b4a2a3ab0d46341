// The table of algorithms: one line for each.
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "learner/algorithm.h"
#include "learner/algorithms/discrete_dbr.h"

namespace dbr {
namespace {

struct Entry {
  const char* name;
  AlgorithmConfig::AlgorithmCase config_case;
  ActionKind actions;
  std::unique_ptr<Algorithm> (*make)(const AlgorithmSpec&);
};

constexpr Entry kAlgorithms[] = {
    {"dbr", AlgorithmConfig::kDbr, ActionKind::kDiscrete, MakeDiscreteDbr},
};

}  // namespace

std::vector<std::string> AlgorithmNames() {
  std::vector<std::string> names;
  for (const Entry& entry : kAlgorithms) names.push_back(entry.name);
  return names;
}

std::string AlgorithmName(const AlgorithmConfig& config) {
  for (const Entry& entry : kAlgorithms) {
    if (entry.config_case == config.algorithm_case()) return entry.name;
  }
  return "";
}

absl::StatusOr<std::unique_ptr<Algorithm>> MakeAlgorithm(const AlgorithmSpec& spec) {
  for (const Entry& entry : kAlgorithms) {
    if (entry.config_case != spec.config.algorithm_case()) continue;
    if (entry.actions == spec.actions.kind) return entry.make(spec);
    return absl::InvalidArgumentError(absl::StrCat("algorithm '", entry.name, "' does not serve the ",
                                                   spec.actions.discrete() ? "discrete" : "continuous",
                                                   " action space of environment '", spec.env, "'"));
  }
  return absl::InvalidArgumentError(absl::StrCat("config field 'algorithm' names none: expected one of ",
                                                 absl::StrJoin(AlgorithmNames(), ", ")));
}

}  // namespace dbr
