// What every actor-critic trains and keeps, with any loss: a policy with its Polyak average, critics, a
// random generator, a counter, and the advantages of the newest update. An algorithm holds one of these, or a
// struct that derives from it and adds networks.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "core/rng.h"
#include "learner/algorithm.h"
#include "learner/training/critic_ensemble.h"
#include "learner/training/learning_rate.h"
#include "learner/training/pair_runner.h"
#include "learner/training/policy_export.h"
#include "learner/training/tensor_state.h"
#include "learner/training/trained_network.h"
#include "nn/policy_networks.h"

namespace dbr {

// The algorithm owns it. One thread at a time, except for functions that `runner` runs side by side.
template <class Scalar>
struct ActorCritic {
  explicit ActorCritic(const AlgorithmSpec& algorithm_spec)
      : spec(algorithm_spec),
        rng(spec.seed),
        runner(UpdateThreads(spec.config)),
        policy(PolicyShape(PolicySpecOf(spec)), Options(spec, /*with_target=*/true), rng),
        critics(CriticShape(PolicySpecOf(spec)), Options(spec, /*with_target=*/true), rng, &runner,
                {.critics = static_cast<int>(spec.config.critics()),
                 .asked = static_cast<int>(spec.config.target_critics())}) {}

  // How the networks of `algorithm_spec` are trained.
  static TrainingOptions Options(const AlgorithmSpec& algorithm_spec, bool with_target) {
    return {.learning_rate = algorithm_spec.config.learning_rate(),
            .with_target = with_target,
            .bfloat16 = std::is_same_v<Scalar, float> && algorithm_spec.bfloat16};
  }

  // Every transition of the batch is drawn from D.
  BatchNeeds needs() const { return {.uniform = static_cast<int>(spec.config.batch_size())}; }

  // Draws the twins of this update. Sets its learning rate, and whether its steps move the targets of the
  // critics and of the policy. The policy's target is the average that a snapshot exports; some algorithms
  // read it in the critics' targets too. Returns the learning rate, for networks that are not in this struct.
  double Begin(bool move_targets = true) {
    const double learning_rate = LearningRate(spec.config, updates);
    const double tau = move_targets ? spec.config.target_tau() : 0;
    critics.ChooseTwins(rng);
    policy.set_learning_rate(learning_rate);
    critics.set_learning_rate(learning_rate);
    policy.set_target_tau(tau);
    critics.set_target_tau(tau);
    return learning_rate;
  }

  // Stores the advantage of each transition of the uniform batch [n]. `advantage` is an Eigen expression.
  template <class Vector>
  void SetAdvantages(const Eigen::MatrixBase<Vector>& advantage) {
    advantages.resize(static_cast<std::size_t>(advantage.size()));
    Eigen::Map<Eigen::VectorXf>(advantages.data(), advantage.size()) = advantage.template cast<float>();
  }

  // Starts a snapshot with the policy, its average and the two critics. An algorithm then adds its own
  // networks.
  void Export(PolicySnapshot* snapshot) const {
    BeginExport(spec, snapshot);
    ExportNetwork(kPolicyNetwork, policy.parameters(), snapshot);
    ExportNetwork(kPolicyAverage, policy.target(), snapshot);
    ExportNetwork(kCritic1, critics.first().parameters(), snapshot);
    ExportNetwork(kCritic2, critics.second().parameters(), snapshot);
  }

  void Save(TensorFile* file) const {
    policy.Save(kPolicyNetwork, file);
    critics.Save(file);
    PutRng(AlgorithmName(spec.config) + ".rng", rng, file);
    PutCounter(AlgorithmName(spec.config) + ".updates", updates, file);
  }
  // Returns DataLoss where a tensor or counter is missing and InvalidArgument where a tensor has another
  // size. Programs before 0.2.0 kept no average of some policies: it then starts from the loaded policy.
  absl::Status Load(const TensorFile& file) {
    absl::Status status = policy.LoadOrStartTarget(kPolicyNetwork, file);
    status.Update(critics.Load(file));
    status.Update(GetRng(AlgorithmName(spec.config) + ".rng", file, &rng));
    status.Update(GetCounter(AlgorithmName(spec.config) + ".updates", file, &updates));
    return status;
  }

  const AlgorithmSpec spec;
  Rng rng;
  PairRunner runner;
  TrainedNetwork<Scalar> policy;
  CriticEnsemble<Scalar> critics;
  std::uint64_t updates = 0;      // that are complete
  std::vector<float> advantages;  // [n] for the newest update's uniform batch
};

}  // namespace dbr
