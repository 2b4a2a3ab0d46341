// What an actor-critic over continuous actions trains, whatever its losses: policy, twin critics, counter.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "core/rng.h"
#include "learner/algorithm.h"
#include "learner/parts/actor_critic_state.h"
#include "learner/parts/learning_rate.h"
#include "learner/parts/pair_runner.h"
#include "learner/parts/trained_network.h"
#include "learner/parts/twin_critic.h"

namespace dbr {

// The policy's network maps a state to a Gaussian before the tanh (nn/gaussian_head.h), a critic's [state;
// action] to one value. One thread at a time, but for what runs on `runner`.
template <class Scalar>
struct ActorCriticNetworks {
  ActorCriticNetworks(const AlgorithmSpec& algorithm_spec, bool policy_target)
      : spec(algorithm_spec),
        rng(spec.seed),
        runner(UpdateThreads(spec.config)),
        policy(MlpShape(spec.observation_size, spec.hidden_sizes, 2 * spec.actions.size),
               spec.config.learning_rate(), policy_target, rng),
        critics(MlpShape(spec.observation_size + spec.actions.size, spec.hidden_sizes, 1),
                spec.config.learning_rate(), rng, &runner) {}

  // All of a batch is drawn from D.
  BatchNeeds needs() const { return {.uniform = static_cast<int>(spec.config.batch_size())}; }

  // Sets the learning rate of this update, and gives it.
  double Begin() {
    const double learning_rate = LearningRate(spec.config, updates);
    policy.set_learning_rate(learning_rate);
    critics.set_learning_rate(learning_rate);
    return learning_rate;
  }

  // A = Q(s, a) - V(s) of each transition [n] into `advantages`.
  void SetAdvantages(const VectorX<Scalar>& behavior_value, const VectorX<Scalar>& state_value) {
    advantages.resize(static_cast<std::size_t>(state_value.size()));
    Eigen::Map<Eigen::VectorXf>(advantages.data(), state_value.size()) =
        (behavior_value - state_value).template cast<float>();
  }

  void Export(PolicySnapshot* snapshot) const { ExportActorCritic(spec, policy, critics, snapshot); }

  void Save(TensorFile* file) const {
    SaveActorCritic(policy, critics, file);
    PutRng(AlgorithmName(spec.config) + ".rng", rng, file);
    PutCounter(AlgorithmName(spec.config) + ".updates", updates, file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = LoadActorCritic(file, &policy, &critics);
    status.Update(GetRng(AlgorithmName(spec.config) + ".rng", file, &rng));
    status.Update(GetCounter(AlgorithmName(spec.config) + ".updates", file, &updates));
    return status;
  }

  const AlgorithmSpec spec;
  Rng rng;
  PairRunner runner;
  TrainedNetwork<Scalar> policy;
  TwinCritic<Scalar> critics;
  std::uint64_t updates = 0;
  std::vector<float> advantages;  // of the newest update's transitions
};

}  // namespace dbr
