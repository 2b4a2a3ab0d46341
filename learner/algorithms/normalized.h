// Any algorithm on normalised observations.
#pragma once

#include <memory>

#include "learner/algorithm.h"

namespace dbr {

// `inner` sees (observation - mean) / deviation of each feature, estimated from all that was drawn uniformly
// so far; the estimate travels with the policy (kObservationNormalizer) and with the checkpoint.
std::unique_ptr<Algorithm> Normalized(const AlgorithmSpec& spec, std::unique_ptr<Algorithm> inner);

}  // namespace dbr
