// The algorithms as `dbr algorithms` shows them.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "learner/algorithm.h"

namespace dbr {

// An algorithm with all the kinds of action that it serves.
struct AlgorithmFacts {
  std::string name;
  std::vector<ActionKind> actions;
  std::string source;                 // the publication
  std::vector<std::string> variants;  // fields of its config message that choose between variants
};

// In the registry's order, each name once.
std::vector<AlgorithmFacts> AllAlgorithms();

// InvalidArgument, naming the nearest or all, for a name that there is not.
absl::StatusOr<AlgorithmFacts> FindAlgorithm(const std::string& name);

// A table: name, actions, source, and each variant with its values.
std::string AlgorithmTable(const std::vector<AlgorithmFacts>& algorithms);

// Name, source and actions, then the config that sets the algorithm, each field with its default and what it
// takes; a config file reads it as it stands.
std::string AlgorithmText(const AlgorithmFacts& algorithm);

// {name, actions, source, variants: {field: [values] or null}, fields: [{name, type, default, values,
// bounds}]}.
nlohmann::ordered_json ToJson(const AlgorithmFacts& algorithm);

}  // namespace dbr
