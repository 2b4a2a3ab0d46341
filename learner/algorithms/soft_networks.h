// What SAC trains, over either kind of action: an actor-critic and its temperature. The parts of an update
// that do not depend on the kind of action are here too.
#pragma once

#include <vector>

#include "absl/container/inlined_vector.h"
#include "absl/status/status.h"
#include "absl/types/span.h"
#include "learner/objectives/soft_policy_loss.h"
#include "learner/training/actor_critic.h"
#include "learner/training/multiplier.h"
#include "learner/training/update_metrics.h"

namespace dbr {

// SAC's networks. The algorithm owns them. One thread at a time.
template <class Scalar>
struct SoftNetworks : ActorCritic<Scalar> {
  // `config` is the spec's SacConfig, DiscreteSacConfig or CalQlConfig.
  template <class TemperatureConfig>
  SoftNetworks(const AlgorithmSpec& spec, const TemperatureConfig& config)
      : ActorCritic<Scalar>(spec),
        temperature(config.first_temperature(), config.temperature_learning_rate(), kTemperatureLimits) {}

  // Ends an update: one step of the temperature, where the update improved the policy. The temperature rises
  // while the policy's entropy is below target_entropy. Both are in nats.
  void Finish(const SoftPolicyLoss<Scalar>& loss, Scalar target_entropy, bool improved = true) {
    if (improved) temperature.Step(target_entropy - loss.entropy);
    ++this->updates;
  }

  // The useful floating-point operations, for n samples, that both kinds of action need: the critics' targets
  // and fits, the policy at s and s', and its gradient in a share `improving` of the updates.
  double UpdateFlops(Eigen::Index n, double improving = 1) const {
    const MlpShape& shape = this->policy.shape();
    return this->critics.TargetFlops(n) + this->critics.FitFlops(n) + 2 * shape.ForwardFlops(n) +
           improving * shape.ParameterGradientFlops(n);
  }

  static std::vector<UpdateMetric> Metrics() {
    return {{"train/critic_loss"},    {"train/actor_loss"},         {"train/temperature"},
            {"train/policy_entropy"}, {"train/value_mean"},         {"train/target_mean"},
            {"train/advantage_mean"}, {"train/advantage_positive"}, {"train/advantage_std"}};
  }

  // Sets `metrics`: Metrics(), and behind them an algorithm's own. Returns Internal where a value is not
  // finite.
  absl::Status Report(Scalar critic_loss, const SoftPolicyLoss<Scalar>& loss, Scalar target_mean,
                      std::vector<UpdateMetric>* metrics, absl::Span<const double> own = {}) const {
    const AdvantageFigures figures = FiguresOf(this->advantages);
    absl::InlinedVector<double, 16> values = {critic_loss,  loss.loss,        temperature.value(),
                                              loss.entropy, loss.value,       target_mean,
                                              figures.mean, figures.positive, figures.deviation};
    values.insert(values.end(), own.begin(), own.end());
    return SetMetrics(values, this->updates, metrics);
  }

  void Save(TensorFile* file) const {
    ActorCritic<Scalar>::Save(file);
    temperature.Save(file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = ActorCritic<Scalar>::Load(file);
    status.Update(temperature.Load(file));
    return status;
  }

  Multiplier<Scalar> temperature;
};

}  // namespace dbr
