// The algorithms by name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/space.h"
#include "learner/algorithm.h"
#include "proto/config.pb.h"

namespace dbr {

// Makes the algorithm that spec.config names. Errors: CheckServes.
absl::StatusOr<std::unique_ptr<Algorithm>> MakeAlgorithm(const AlgorithmSpec& spec);

// InvalidArgument, naming those that do, unless the algorithm that `config` sets serves the actions of the
// environment; or, naming the field, where the variant that it chooses does not.
absl::Status CheckServes(const AlgorithmConfig& config, const std::string& env, const ActionSpace& actions);

// All algorithms, once for each kind of action that they serve; the conformance suite walks them.
struct AlgorithmId {
  std::string name;  // as the member of AlgorithmConfig's oneof that sets it
  ActionKind actions;
  std::string source;    // the publication
  std::string variants;  // the fields of its config message that choose between variants; may be empty
};
std::vector<AlgorithmId> Algorithms();

}  // namespace dbr
