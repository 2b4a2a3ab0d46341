// Runs any algorithm on transitions of which half are images under the symmetry of the environment.
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "core/space.h"
#include "learner/algorithm.h"

namespace dbr {

// Wraps `inner` and owns it. Each transition of an update's three batches is replaced, with probability 1/2,
// by its image under spec.symmetry: observations, masks and actions change places; rewards, discounts,
// returns and keys stay. The advantage of an image counts for the transition itself. Whether a transition is
// replaced comes from a random generator of its own, which follows from spec.seed and is saved in the
// checkpoint. A checkpoint that was written without it is refused with DataLoss.
//
// Requires CheckMirror. Where observations are normalised too, the normaliser is within: it sees the images.
std::unique_ptr<Algorithm> Mirrored(const AlgorithmSpec& spec, std::unique_ptr<Algorithm> inner);

// Returns InvalidArgument where `config` asks for images and `env` has no symmetry, or one that does not fit
// its sizes.
absl::Status CheckMirror(const AlgorithmConfig& config, const EnvSpec& env);

}  // namespace dbr
