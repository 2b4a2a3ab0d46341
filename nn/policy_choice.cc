#include "nn/policy_choice.h"

#include <utility>

#include "absl/status/statusor.h"

namespace dbr {

std::string NameOf(PolicyChoice choice) {
  return choice == AVERAGE ? "average" : "raw";
}

PolicyChoice ServedChoice(const PolicySnapshot& snapshot, PolicyChoice choice) {
  return snapshot.Find(kPolicyAverage) != nullptr ? choice : RAW;
}

std::shared_ptr<const PolicyNetworks> WithActing(std::shared_ptr<const PolicyNetworks> policy,
                                                 PolicyChoice choice) {
  const PolicySnapshot& snapshot = policy->snapshot();
  if (snapshot.Find(kPolicyAverage) == nullptr) return policy;
  const char* const chosen = choice == AVERAGE ? kPolicyAverage : kPolicyNetwork;
  PolicySnapshot acting = {.version = snapshot.version,
                           .updates = snapshot.updates,
                           .spec = snapshot.spec,
                           .support_epsilon = snapshot.support_epsilon,
                           .networks = {}};
  for (const auto& [name, parameters] : snapshot.networks) {
    if (name == kPolicyNetwork) {
      acting.networks.emplace_back(name, *snapshot.Find(chosen));
    } else if (name != kPolicyAverage) {
      acting.networks.emplace_back(name, parameters);
    }
  }
  return PolicyNetworks::Create(std::move(acting)).value();  // both policies have one shape
}

}  // namespace dbr
