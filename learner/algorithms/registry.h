// Makes algorithms by name. Thread-safe: pure functions.
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

// Makes the algorithm that spec.config names. Returns the errors of CheckServes and CheckMirror
// (learner/algorithms/mirrored.h).
absl::StatusOr<std::unique_ptr<Algorithm>> MakeAlgorithm(const AlgorithmSpec& spec);

// Checks that the algorithm that `config` sets serves the environment's actions. Returns InvalidArgument
// otherwise, with the names of those that do. Where only a chosen variant does not serve them, the error
// names its field.
absl::Status CheckServes(const AlgorithmConfig& config, const std::string& env, const ActionSpace& actions);

// All algorithms, once for each kind of action that they serve. The conformance suite tests each of them.
struct AlgorithmId {
  std::string name;  // the member of AlgorithmConfig's oneof that sets it
  ActionKind actions;
  std::string source;    // the publication
  std::string variants;  // the fields of its config message that choose between variants; may be empty
};
std::vector<AlgorithmId> Algorithms();

}  // namespace dbr
