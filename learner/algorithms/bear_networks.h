// What BEAR trains beside its behaviour model, over either kind of action: an actor-critic and its
// multiplier. The parts of an update that do not depend on the kind of action are here too.
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "learner/objectives/dual_behavior.h"
#include "learner/training/actor_critic.h"
#include "learner/training/multiplier.h"
#include "learner/training/update_metrics.h"

namespace dbr {

// BEAR's networks without the behaviour model. The algorithm owns them. One thread at a time.
template <class Scalar>
struct BearNetworks : ActorCritic<Scalar> {
  explicit BearNetworks(const AlgorithmSpec& spec)
      : ActorCritic<Scalar>(spec),
        multiplier(spec.config.bear().first_multiplier(), spec.config.bear().multiplier_learning_rate()) {}

  // Whether the warm start is over.
  bool UseQ() const { return this->updates >= this->spec.config.bear().warm_start_updates(); }

  // Ends an update: one step of the multiplier.
  void Finish(const ConstrainedLoss<Scalar>& loss) {
    multiplier.Step(loss.divergence - loss.threshold);
    ++this->updates;
  }

  static std::vector<UpdateMetric> Metrics() {
    return {{"train/critic_loss"},        {"train/actor_loss"},   {"train/behavior_loss"},
            {"train/divergence"},         {"train/multiplier"},   {"train/policy_entropy"},
            {"train/value_mean"},         {"train/target_mean"},  {"train/advantage_mean"},
            {"train/advantage_positive"}, {"train/advantage_std"}};
  }

  // The losses of the two fits of one update.
  struct FitLosses {
    Scalar critic = 0;    // the mean of the twins' losses
    Scalar behavior = 0;  // the behaviour model's loss
  };

  // Sets `metrics`. Returns Internal where a value is not finite.
  absl::Status Report(const FitLosses& fits, const ConstrainedLoss<Scalar>& loss, Scalar target_mean,
                      std::vector<UpdateMetric>* metrics) const {
    const AdvantageFigures figures = FiguresOf(this->advantages);
    return SetMetrics(
        {fits.critic, loss.loss, fits.behavior, loss.divergence, multiplier.value(), loss.entropy, loss.value,
         target_mean, figures.mean, figures.positive, figures.deviation},
        this->updates, metrics);
  }

  void Save(TensorFile* file) const {
    ActorCritic<Scalar>::Save(file);
    multiplier.Save(file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = ActorCritic<Scalar>::Load(file);
    status.Update(multiplier.Load(file));
    return status;
  }

  Multiplier<Scalar> multiplier;
};

}  // namespace dbr
