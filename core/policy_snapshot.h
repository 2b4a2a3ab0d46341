// A version of what the learner has learned, as the actors, the evaluator and policy files hold it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/space.h"

namespace dbr {

// Which environment and which networks a policy is made for.
struct PolicySpec {
  std::string env;
  std::string algorithm;
  int observation_size = 0;  // floats
  ActionSpace actions;
  std::vector<int> hidden_sizes;
  bool critic_layer_norm = false;  // whether the critics normalise their hidden layers

  bool operator==(const PolicySpec&) const = default;
};

// Names of the networks in a snapshot. A snapshot always holds kPolicyNetwork; an algorithm adds those that
// it has.
inline constexpr char kPolicyNetwork[] = "policy";
inline constexpr char kPolicyAverage[] = "policy_average";  // the Polyak average of "policy"
inline constexpr char kCritic1[] = "critic_1";
inline constexpr char kCritic2[] = "critic_2";
inline constexpr char kBetaPlus[] = "beta_plus";
inline constexpr char kBetaMinus[] = "beta_minus";
inline constexpr char kBehavior[] = "behavior";  // beta, fitted to all of the data
// Not a network: the mean of each feature, then one over its standard deviation; absent where the networks
// take observations as they are.
inline constexpr char kObservationNormalizer[] = "observation_normalizer";

// Plain values. A snapshot does not change once it is published: processes share it by pointer.
struct PolicySnapshot {
  std::uint64_t version = 0;        // counts pushes, from 1
  std::uint64_t updates = 0;        // updates of the learner behind it
  bool ends_offline_phase = false;  // the learner waits for an evaluation of it; not in files
  PolicySpec spec;
  float support_epsilon = 0.05f;  // the eps of the acting mode SUPPORT
  // Name and parameters of each network, flat as Mlp (nn/mlp.h) lays them.
  std::vector<std::pair<std::string, std::vector<float>>> networks;

  // The parameters of a network, or null.
  const std::vector<float>* Find(absl::string_view name) const {
    for (const auto& [key, parameters] : networks) {
      if (key == name) return &parameters;
    }
    return nullptr;
  }
};

// CRC-32C over the parameters of all networks, in order.
std::uint32_t Checksum(const PolicySnapshot& snapshot);

// Checks that `found` is a policy for what `expected` asks. InvalidArgument names each field that differs.
absl::Status CheckSameSpec(const PolicySpec& expected, const PolicySpec& found);

}  // namespace dbr
