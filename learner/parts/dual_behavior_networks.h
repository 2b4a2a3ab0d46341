// What DBR trains, whatever the actions: networks, multiplier and counter, and the parts of an update that do
// not depend on the kind of action.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "learner/algorithm.h"
#include "learner/parts/actor_critic_state.h"
#include "learner/parts/dual_behavior.h"
#include "learner/parts/learning_rate.h"
#include "learner/parts/multiplier.h"
#include "learner/parts/pair_runner.h"
#include "learner/parts/policy_export.h"
#include "learner/parts/trained_network.h"
#include "learner/parts/twin_critic.h"
#include "learner/parts/update_metrics.h"

namespace dbr {

// Losses of one update's fits.
template <class Scalar>
struct FitLosses {
  Scalar critic = 0;      // the twins' mean
  Scalar beta_plus = 0;   // mean of -log beta+(a|s)
  Scalar beta_minus = 0;  // mean of -log beta-(a|s)
};

// One thread at a time, but for what runs on `runner`.
template <class Scalar>
struct DualBehaviorNetworks {
  DualBehaviorNetworks(const AlgorithmSpec& spec, const MlpShape& policy_shape, const MlpShape& critic_shape,
                       Rng& rng)
      : runner(UpdateThreads(spec.config)),
        policy(policy_shape, spec.config.learning_rate(), /*with_target=*/true, rng),
        critics(critic_shape, spec.config.learning_rate(), rng, &runner),
        beta_plus(policy_shape, spec.config.learning_rate(), /*with_target=*/false, rng),
        beta_minus(policy_shape, spec.config.learning_rate(), /*with_target=*/false, rng),
        multiplier(spec.config.dbr().first_multiplier(), spec.config.dbr().multiplier_learning_rate()),
        constrained(spec.config.dbr().constraint() != DbrConfig::NONE) {}

  // The multiplier of the divergence; 0 where there is no constraint.
  Scalar alpha() const { return constrained ? multiplier.value() : Scalar{0}; }

  // Sets the learning rate of this update.
  void Begin(const AlgorithmConfig& config) {
    const double learning_rate = LearningRate(config, updates);
    policy.set_learning_rate(learning_rate);
    critics.set_learning_rate(learning_rate);
    beta_plus.set_learning_rate(learning_rate);
    beta_minus.set_learning_rate(learning_rate);
  }

  // The multiplier's step, and the targets'.
  void Finish(const AlgorithmConfig& config, const PolicyLoss<Scalar>& loss) {
    if (constrained) multiplier.Step(loss.divergence_plus - loss.threshold);
    critics.UpdateTargets(config.target_tau());
    policy.UpdateTarget(config.target_tau());
    ++updates;
  }

  // Useful operations of the policies: both fits, and with `next_policies` forward passes at s' the rest.
  double PolicyFlops(const BatchNeeds& needs, int next_policies) const {
    const MlpShape& shape = policy.shape();
    double flops = 0;
    for (const int behavior : {needs.plus, needs.minus}) {
      flops += shape.ForwardFlops(behavior) + shape.ParameterGradientFlops(behavior);
    }
    // Self-imitation fits beta+ to B, where it was evaluated already.
    if (needs.plus == 0) flops += shape.ParameterGradientFlops(needs.uniform);
    const int forward = 3 + next_policies;  // pi, beta+ and beta- at s
    return flops + forward * shape.ForwardFlops(needs.uniform) + shape.ParameterGradientFlops(needs.uniform);
  }

  static std::vector<UpdateMetric> Metrics() {
    return {{"train/critic_loss"},        {"train/actor_loss"},      {"train/beta_plus_loss"},
            {"train/beta_minus_loss"},    {"train/divergence_plus"}, {"train/divergence_minus"},
            {"train/threshold"},          {"train/multiplier"},      {"train/policy_entropy"},
            {"train/value_mean"},         {"train/target_mean"},     {"train/advantage_mean"},
            {"train/advantage_positive"}, {"train/advantage_std"}};
  }

  // Sets `metrics`; Internal where one is not finite.
  absl::Status Report(const FitLosses<Scalar>& fits, const PolicyLoss<Scalar>& loss, Scalar target_mean,
                      const std::vector<float>& advantages, std::vector<UpdateMetric>* metrics) const {
    const AdvantageFigures figures = FiguresOf(advantages);
    return SetMetrics({fits.critic, loss.loss, fits.beta_plus, fits.beta_minus, loss.divergence_plus,
                       loss.divergence_minus, loss.threshold, alpha(), loss.entropy, loss.value, target_mean,
                       figures.mean, figures.positive, figures.deviation},
                      updates, metrics);
  }

  void Export(const AlgorithmSpec& spec, PolicySnapshot* snapshot) const {
    ExportActorCritic(spec, policy, critics, snapshot);
    snapshot->support_epsilon = static_cast<float>(spec.config.dbr().epsilon());
    ExportNetwork(kBetaPlus, beta_plus.parameters(), snapshot);
    ExportNetwork(kBetaMinus, beta_minus.parameters(), snapshot);
  }

  void Save(TensorFile* file) const {
    SaveActorCritic(policy, critics, file);
    beta_plus.Save(kBetaPlus, file);
    beta_minus.Save(kBetaMinus, file);
    multiplier.Save(file);
    PutCounter("dbr.updates", updates, file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = LoadActorCritic(file, &policy, &critics);
    status.Update(beta_plus.Load(kBetaPlus, file));
    status.Update(beta_minus.Load(kBetaMinus, file));
    status.Update(multiplier.Load(file));
    status.Update(GetCounter("dbr.updates", file, &updates));
    return status;
  }

  PairRunner runner;
  TrainedNetwork<Scalar> policy;
  TwinCritic<Scalar> critics;
  TrainedNetwork<Scalar> beta_plus;
  TrainedNetwork<Scalar> beta_minus;
  Multiplier<Scalar> multiplier;
  const bool constrained;
  std::uint64_t updates = 0;
};

}  // namespace dbr
