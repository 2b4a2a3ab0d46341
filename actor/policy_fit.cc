#include "actor/policy_fit.h"

namespace dbr {

absl::Status CheckPolicyFits(const PolicySpec& policy, const EnvSpec& env) {
  PolicySpec expected = policy;
  expected.env = env.name;
  expected.observation_size = env.observation_size;
  expected.actions = env.actions;
  return CheckSameSpec(expected, policy);
}

}  // namespace dbr
