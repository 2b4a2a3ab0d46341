// What BEAR trains beside its behaviour model, whatever the actions: networks, multiplier and counter, and
// the parts of an update that do not depend on the kind of action.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "core/rng.h"
#include "learner/algorithm.h"
#include "learner/parts/actor_critic_state.h"
#include "learner/parts/dual_behavior.h"
#include "learner/parts/learning_rate.h"
#include "learner/parts/multiplier.h"
#include "learner/parts/pair_runner.h"
#include "learner/parts/trained_network.h"
#include "learner/parts/twin_critic.h"
#include "learner/parts/update_metrics.h"

namespace dbr {

// One thread at a time, but for what runs on `runner`.
template <class Scalar>
struct BearNetworks {
  BearNetworks(const AlgorithmSpec& spec, const MlpShape& policy_shape, const MlpShape& critic_shape,
               Rng& rng)
      : runner(UpdateThreads(spec.config)),
        policy(policy_shape, spec.config.learning_rate(), /*with_target=*/true, rng),
        critics(critic_shape, spec.config.learning_rate(), rng, &runner),
        multiplier(spec.config.bear().first_multiplier(), spec.config.bear().multiplier_learning_rate()) {}

  // Sets the learning rate of this update and gives it, for the behaviour model.
  double Begin(const AlgorithmConfig& config) {
    const double learning_rate = LearningRate(config, updates);
    policy.set_learning_rate(learning_rate);
    critics.set_learning_rate(learning_rate);
    return learning_rate;
  }

  // Whether the warm start is over.
  bool UseQ(const BearConfig& config) const { return updates >= config.warm_start_updates(); }

  // The multiplier's step, and the targets'.
  void Finish(const AlgorithmConfig& config, const ConstrainedLoss<Scalar>& loss) {
    multiplier.Step(loss.divergence - loss.threshold);
    critics.UpdateTargets(config.target_tau());
    policy.UpdateTarget(config.target_tau());
    ++updates;
  }

  static std::vector<UpdateMetric> Metrics() {
    return {{"train/critic_loss"},        {"train/actor_loss"},   {"train/behavior_loss"},
            {"train/divergence"},         {"train/multiplier"},   {"train/policy_entropy"},
            {"train/value_mean"},         {"train/target_mean"},  {"train/advantage_mean"},
            {"train/advantage_positive"}, {"train/advantage_std"}};
  }

  // Losses of one update's fits.
  struct FitLosses {
    Scalar critic = 0;    // the twins' mean
    Scalar behavior = 0;  // of the behaviour model
  };

  // Sets `metrics`; Internal where one is not finite.
  absl::Status Report(const FitLosses& fits, const ConstrainedLoss<Scalar>& loss, Scalar target_mean,
                      const std::vector<float>& advantages, std::vector<UpdateMetric>* metrics) const {
    const AdvantageFigures figures = FiguresOf(advantages);
    return SetMetrics(
        {fits.critic, loss.loss, fits.behavior, loss.divergence, multiplier.value(), loss.entropy, loss.value,
         target_mean, figures.mean, figures.positive, figures.deviation},
        updates, metrics);
  }

  void Export(const AlgorithmSpec& spec, PolicySnapshot* snapshot) const {
    ExportActorCritic(spec, policy, critics, snapshot);
  }

  void Save(TensorFile* file) const {
    SaveActorCritic(policy, critics, file);
    multiplier.Save(file);
    PutCounter("bear.updates", updates, file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = LoadActorCritic(file, &policy, &critics);
    status.Update(multiplier.Load(file));
    status.Update(GetCounter("bear.updates", file, &updates));
    return status;
  }

  PairRunner runner;
  TrainedNetwork<Scalar> policy;
  TwinCritic<Scalar> critics;
  Multiplier<Scalar> multiplier;
  std::uint64_t updates = 0;
};

}  // namespace dbr
