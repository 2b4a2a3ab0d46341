// What SAC trains, whatever the actions: networks, temperature and counter, and the parts of an update that
// do not depend on the kind of action.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "core/rng.h"
#include "learner/algorithm.h"
#include "learner/parts/actor_critic_state.h"
#include "learner/parts/learning_rate.h"
#include "learner/parts/multiplier.h"
#include "learner/parts/pair_runner.h"
#include "learner/parts/soft_policy_loss.h"
#include "learner/parts/trained_network.h"
#include "learner/parts/twin_critic.h"
#include "learner/parts/update_metrics.h"

namespace dbr {

// A temperature may fall low where rewards are small; above e^5 it is out of hand.
inline constexpr MultiplierLimits kTemperatureLimits{.min_log = -20, .max_log = 5};

// One thread at a time, but for what runs on `runner`.
template <class Scalar>
struct SoftNetworks {
  // `config` is the SacConfig or the SacDiscreteConfig of the spec.
  template <class TemperatureConfig>
  SoftNetworks(const AlgorithmSpec& spec, const TemperatureConfig& config, const MlpShape& policy_shape,
               const MlpShape& critic_shape, Rng& rng)
      : runner(UpdateThreads(spec.config)),
        policy(policy_shape, spec.config.learning_rate(), /*with_target=*/false, rng),
        critics(critic_shape, spec.config.learning_rate(), rng, &runner),
        temperature(config.first_temperature(), config.temperature_learning_rate(), kTemperatureLimits) {}

  // Sets the learning rate of this update.
  void Begin(const AlgorithmConfig& config) {
    const double learning_rate = LearningRate(config, updates);
    policy.set_learning_rate(learning_rate);
    critics.set_learning_rate(learning_rate);
  }

  // The temperature's step (it rises while the policy's entropy is below target_entropy, both in nats), and
  // the targets'.
  void Finish(const AlgorithmConfig& config, const SoftPolicyLoss<Scalar>& loss, Scalar target_entropy) {
    temperature.Step(target_entropy - loss.entropy);
    critics.UpdateTargets(config.target_tau());
    ++updates;
  }

  // Useful operations for n samples of what both kinds of action need: the critics' targets and fits, the
  // policy at s and s', and its gradient.
  double UpdateFlops(Eigen::Index n) const {
    return critics.TargetFlops(n) + critics.FitFlops(n) + 2 * policy.shape().ForwardFlops(n) +
           policy.shape().ParameterGradientFlops(n);
  }

  static std::vector<UpdateMetric> Metrics() {
    return {{"train/critic_loss"},    {"train/actor_loss"},         {"train/temperature"},
            {"train/policy_entropy"}, {"train/value_mean"},         {"train/target_mean"},
            {"train/advantage_mean"}, {"train/advantage_positive"}, {"train/advantage_std"}};
  }

  // Sets `metrics`; Internal where one is not finite.
  absl::Status Report(Scalar critic_loss, const SoftPolicyLoss<Scalar>& loss, Scalar target_mean,
                      const std::vector<float>& advantages, std::vector<UpdateMetric>* metrics) const {
    const AdvantageFigures figures = FiguresOf(advantages);
    return SetMetrics({critic_loss, loss.loss, temperature.value(), loss.entropy, loss.value, target_mean,
                       figures.mean, figures.positive, figures.deviation},
                      updates, metrics);
  }

  void Export(const AlgorithmSpec& spec, PolicySnapshot* snapshot) const {
    ExportActorCritic(spec, policy, critics, snapshot);
  }

  void Save(TensorFile* file) const {
    SaveActorCritic(policy, critics, file);
    temperature.Save(file);
    PutCounter("sac.updates", updates, file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = LoadActorCritic(file, &policy, &critics);
    status.Update(temperature.Load(file));
    status.Update(GetCounter("sac.updates", file, &updates));
    return status;
  }

  PairRunner runner;
  TrainedNetwork<Scalar> policy;
  TwinCritic<Scalar> critics;
  Multiplier<Scalar> temperature;
  std::uint64_t updates = 0;
};

}  // namespace dbr
