// Untrained policies for the tests of this folder.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/policy_snapshot.h"
#include "core/rng.h"
#include "envs/registry/registry.h"
#include "nn/mlp.h"
#include "nn/policy.h"

namespace dbr {

// Returns a snapshot with networks of two hidden layers of 16. `version` decides their parameters.
inline PolicySnapshot UntrainedSnapshot(const EnvSpec& env, std::uint64_t version, bool with_critics = true) {
  PolicySnapshot snapshot;
  snapshot.version = version;
  snapshot.updates = 10 * version;
  snapshot.spec = {.env = env.name,
                   .algorithm = "dbr",
                   .observation_size = env.observation_size,
                   .actions = env.actions,
                   .hidden_sizes = {16, 16}};
  const MlpShape shape(env.observation_size, snapshot.spec.hidden_sizes, env.actions.size);
  Rng rng(version);
  std::vector<std::string> names = {kPolicyNetwork};
  if (with_critics) names.insert(names.end(), {kCritic1, kCritic2});
  for (const std::string& name : names) {
    const VectorX<float> parameters = InitialParameters<float>(shape, rng) * 4;  // far from ties
    snapshot.networks.emplace_back(name, std::vector<float>(parameters.begin(), parameters.end()));
  }
  return snapshot;
}

inline std::shared_ptr<const PolicyNetworks> UntrainedPolicy(const EnvSpec& env, std::uint64_t version,
                                                             bool with_critics = true) {
  return PolicyNetworks::Create(UntrainedSnapshot(env, version, with_critics)).value();
}

// Returns `raw` with an average, which is the policy of `average`.
inline PolicySnapshot WithAverage(PolicySnapshot raw, const PolicySnapshot& average) {
  raw.networks.emplace_back(kPolicyAverage, *average.Find(kPolicyNetwork));
  return raw;
}

inline EnvSpec Connect4Spec() {
  return MakeEnv({.name = "connect4", .opponents = {}}).value()->spec();
}

}  // namespace dbr
