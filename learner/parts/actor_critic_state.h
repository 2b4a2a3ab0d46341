// A policy and its twin critics in snapshots and checkpoints; every actor-critic has these.
#pragma once

#include "absl/status/status.h"
#include "learner/algorithm.h"
#include "learner/parts/policy_export.h"
#include "learner/parts/trained_network.h"
#include "learner/parts/twin_critic.h"

namespace dbr {

// Begins a snapshot with the three networks; an algorithm adds those of its own.
template <class Scalar>
void ExportActorCritic(const AlgorithmSpec& spec, const TrainedNetwork<Scalar>& policy,
                       const TwinCritic<Scalar>& critics, PolicySnapshot* snapshot) {
  BeginExport(spec, snapshot);
  ExportNetwork(kPolicyNetwork, policy.parameters(), snapshot);
  ExportNetwork(kCritic1, critics.first().parameters(), snapshot);
  ExportNetwork(kCritic2, critics.second().parameters(), snapshot);
}

template <class Scalar>
void SaveActorCritic(const TrainedNetwork<Scalar>& policy, const TwinCritic<Scalar>& critics,
                     TensorFile* file) {
  policy.Save(kPolicyNetwork, file);
  critics.Save(file);
}

// Errors as TrainedNetwork::Load's.
template <class Scalar>
absl::Status LoadActorCritic(const TensorFile& file, TrainedNetwork<Scalar>* policy,
                             TwinCritic<Scalar>* critics) {
  absl::Status status = policy->Load(kPolicyNetwork, file);
  status.Update(critics->Load(file));
  return status;
}

}  // namespace dbr
