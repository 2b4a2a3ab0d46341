// What DBR trains, over either kind of action: an actor-critic, the behaviour policies for D+ and D-, and the
// multiplier. The parts of an update that do not depend on the kind of action are here too.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "learner/objectives/dual_behavior.h"
#include "learner/training/actor_critic.h"
#include "learner/training/multiplier.h"
#include "learner/training/update_metrics.h"

namespace dbr {

// The losses of the fits of one update.
template <class Scalar>
struct FitLosses {
  Scalar critic = 0;      // the mean of the twins' losses
  Scalar beta_plus = 0;   // mean of -log beta+(a|s)
  Scalar beta_minus = 0;  // mean of -log beta-(a|s)
};

// DBR's networks. The algorithm owns them. One thread at a time.
template <class Scalar>
struct DualBehaviorNetworks : ActorCritic<Scalar> {
  explicit DualBehaviorNetworks(const AlgorithmSpec& spec)
      : ActorCritic<Scalar>(spec),
        beta_plus(this->policy.shape(), this->Options(spec, /*with_target=*/false), this->rng),
        beta_minus(this->policy.shape(), this->Options(spec, /*with_target=*/false), this->rng),
        multiplier(spec.config.dbr().first_multiplier(), spec.config.dbr().multiplier_learning_rate()),
        constrained(spec.config.dbr().constraint() != DbrConfig::NONE) {}

  const DbrConfig& config() const { return this->spec.config.dbr(); }
  BatchNeeds needs() const { return DualBehaviorNeeds(this->spec.config); }

  // The multiplier of the divergence. It is 0 where there is no constraint.
  Scalar alpha() const { return constrained ? multiplier.value() : Scalar{0}; }

  // Sets the learning rate of this update.
  void Begin() {
    const double learning_rate = ActorCritic<Scalar>::Begin();
    beta_plus.set_learning_rate(learning_rate);
    beta_minus.set_learning_rate(learning_rate);
  }

  // Ends an update: one step of the multiplier.
  void Finish(const PolicyLoss<Scalar>& loss) {
    if (constrained) multiplier.Step(loss.divergence_plus - loss.threshold);
    ++this->updates;
  }

  // The useful floating-point operations of the policies: the fits and all forward passes.
  double PolicyFlops() const {
    const MlpShape& shape = this->policy.shape();
    const BatchNeeds batch = needs();
    double flops = 0;
    for (const int behavior : {batch.plus, batch.minus}) {
      flops += shape.ForwardFlops(behavior) + shape.ParameterGradientFlops(behavior);
    }
    // Self-imitation fits beta+ to B. Its forward pass at s is counted below.
    if (batch.plus == 0) flops += shape.ParameterGradientFlops(batch.uniform);
    // At s: pi, beta+ and beta-, whether the constraint looks at beta- or not, so that what is left out shows
    // as time. At s': the target pi', and beta+ too where the value is penalised.
    const int forward = config().value_penalty() && constrained ? 5 : 4;
    return flops + forward * shape.ForwardFlops(batch.uniform) + shape.ParameterGradientFlops(batch.uniform);
  }

  static std::vector<UpdateMetric> Metrics() {
    return {{"train/critic_loss"},        {"train/actor_loss"},      {"train/beta_plus_loss"},
            {"train/beta_minus_loss"},    {"train/divergence_plus"}, {"train/divergence_minus"},
            {"train/threshold"},          {"train/multiplier"},      {"train/policy_entropy"},
            {"train/value_mean"},         {"train/target_mean"},     {"train/advantage_mean"},
            {"train/advantage_positive"}, {"train/advantage_std"}};
  }

  // Sets `metrics`. Returns Internal where a value is not finite.
  absl::Status Report(const FitLosses<Scalar>& fits, const PolicyLoss<Scalar>& loss, Scalar target_mean,
                      std::vector<UpdateMetric>* metrics) const {
    const AdvantageFigures figures = FiguresOf(this->advantages);
    return SetMetrics({fits.critic, loss.loss, fits.beta_plus, fits.beta_minus, loss.divergence_plus,
                       loss.divergence_minus, loss.threshold, alpha(), loss.entropy, loss.value, target_mean,
                       figures.mean, figures.positive, figures.deviation},
                      this->updates, metrics);
  }

  void Export(PolicySnapshot* snapshot) const {
    ActorCritic<Scalar>::Export(snapshot);
    snapshot->support_epsilon = static_cast<float>(config().epsilon());
    ExportNetwork(kBetaPlus, beta_plus.parameters(), snapshot);
    ExportNetwork(kBetaMinus, beta_minus.parameters(), snapshot);
  }

  void Save(TensorFile* file) const {
    ActorCritic<Scalar>::Save(file);
    beta_plus.Save(kBetaPlus, file);
    beta_minus.Save(kBetaMinus, file);
    multiplier.Save(file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = ActorCritic<Scalar>::Load(file);
    status.Update(beta_plus.Load(kBetaPlus, file));
    status.Update(beta_minus.Load(kBetaMinus, file));
    status.Update(multiplier.Load(file));
    return status;
  }

  TrainedNetwork<Scalar> beta_plus;
  TrainedNetwork<Scalar> beta_minus;
  Multiplier<Scalar> multiplier;
  const bool constrained;
};

}  // namespace dbr
