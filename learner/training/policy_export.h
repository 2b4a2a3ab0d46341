// Fills a policy's snapshot from an algorithm's networks.
#pragma once

#include <vector>

#include "learner/algorithm.h"

namespace dbr {

inline PolicySpec PolicySpecOf(const AlgorithmSpec& spec) {
  return {.env = spec.env,
          .algorithm = AlgorithmName(spec.config),
          .observation_size = spec.observation_size,
          .actions = spec.actions,
          .hidden_sizes = spec.hidden_sizes,
          .critic_layer_norm = spec.critic_layer_norm};
}

// Sets the snapshot's spec and removes its networks.
inline void BeginExport(const AlgorithmSpec& spec, PolicySnapshot* snapshot) {
  snapshot->spec = PolicySpecOf(spec);
  snapshot->networks.clear();
}

// Adds a network's parameters to the snapshot, in single precision.
template <class Scalar>
void ExportNetwork(const char* name, const VectorX<Scalar>& parameters, PolicySnapshot* snapshot) {
  snapshot->networks.emplace_back(name, std::vector<float>(parameters.begin(), parameters.end()));
}

}  // namespace dbr
