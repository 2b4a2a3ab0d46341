// Whether a policy can act in an environment.
#pragma once

#include "absl/status/status.h"
#include "core/policy_snapshot.h"
#include "core/space.h"

namespace dbr {

// InvalidArgument, naming each field that differs with what was expected and found, where the policy was made
// for another environment or for other observations or actions. Its algorithm and its networks' sizes do not
// count.
absl::Status CheckPolicyFits(const PolicySpec& policy, const EnvSpec& env);

}  // namespace dbr
