// What TD3, TD3+BC and ReBRAC differ in.
#pragma once

#include <cstdint>

#include "learner/algorithm.h"
#include "learner/objectives/deterministic_policy.h"

namespace dbr {

struct Td3Terms {
  SmoothingOptions smoothing;       // of the target's actions
  std::uint32_t policy_delay = 2;   // updates for each of the policy and of the targets
  DeterministicPolicyTerms policy;  // of the policy's loss
  double critic_penalty = 0;        // the weight of the squared distance to the next action in the target

  // The terms of spec.config, which is a td3, a td3_bc or a rebrac. TD3+BC takes the mean of the distance
  // over the dimensions, where the policy's loss has their sum.
  static Td3Terms Of(const AlgorithmSpec& spec) {
    if (spec.config.has_td3_bc()) {
      const Td3BcConfig& config = spec.config.td3_bc();
      return {
          .smoothing = {config.target_noise(), config.target_noise_limit()},
          .policy_delay = config.policy_delay(),
          .policy = {.normalize_q = true, .q_weight = config.q_weight(), .penalty = 1.0 / spec.actions.size}};
    }
    if (spec.config.has_rebrac()) {
      const RebracConfig& config = spec.config.rebrac();
      return {.smoothing = {config.target_noise(), config.target_noise_limit()},
              .policy_delay = config.policy_delay(),
              .policy = {.normalize_q = true, .penalty = config.policy_penalty()},
              .critic_penalty = config.critic_penalty()};
    }
    const Td3Config& config = spec.config.td3();
    return {.smoothing = {config.target_noise(), config.target_noise_limit()},
            .policy_delay = config.policy_delay()};
  }
};

}  // namespace dbr
