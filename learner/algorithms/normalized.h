// Runs any algorithm on normalised observations.
#pragma once

#include <memory>

#include "learner/algorithm.h"

namespace dbr {

// Wraps `inner` and owns it. `inner` sees (observation - mean) / deviation for each feature. Both are
// estimated from all observations that were drawn uniformly so far. The estimate is exported with the policy
// (kObservationNormalizer) and saved in the checkpoint.
std::unique_ptr<Algorithm> Normalized(const AlgorithmSpec& spec, std::unique_ptr<Algorithm> inner);

}  // namespace dbr
