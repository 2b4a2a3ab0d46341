// Which of a learner's two policies acts: the raw one of its newest update, or the Polyak average over its
// updates. Evaluations choose; actors always act by the raw one.
#pragma once

#include <memory>
#include <string>

#include "core/policy_snapshot.h"
#include "nn/policy_networks.h"
#include "proto/config.pb.h"

namespace dbr {

// "raw" or "average".
std::string NameOf(PolicyChoice choice);

// The choice that can be had of `snapshot`: `choice`, but RAW where the snapshot has no average.
PolicyChoice ServedChoice(const PolicySnapshot& snapshot, PolicyChoice choice);

// Returns `policy` with the served choice as its network "policy" and without "policy_average", so that
// nobody who acts by it needs to know of the choice. The other networks stay. Copies the networks; a policy
// without an average is returned as it is.
std::shared_ptr<const PolicyNetworks> WithActing(std::shared_ptr<const PolicyNetworks> policy,
                                                 PolicyChoice choice);

}  // namespace dbr
