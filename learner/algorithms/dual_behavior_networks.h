// What DBR trains, over either kind of action: an actor-critic, the behaviour policies for D+ and D-, and the
// multiplier. The parts of an update that do not depend on the kind of action are here too.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "learner/objectives/batch_partition.h"
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
        multiplier(spec.config.dbr().first_multiplier(), spec.config.dbr().multiplier_learning_rate(),
                   MultiplierLimits::Between(spec.config.dbr().min_multiplier(),
                                             spec.config.dbr().max_multiplier())),
        temperature(FirstTemperature(spec.config.dbr()), spec.config.dbr().temperature_learning_rate(),
                    kTemperatureLimits),
        constrained(spec.config.dbr().constraint() != DbrConfig::NONE),
        soft(spec.config.dbr().first_temperature() > 0) {}

  const DbrConfig& config() const { return this->spec.config.dbr(); }
  BatchNeeds needs() const { return DualBehaviorNeeds(this->spec.config); }

  // The multiplier of the divergence. It is 0 where there is no constraint.
  Scalar alpha() const { return constrained ? Given(controls.multiplier, multiplier.value()) : Scalar{0}; }

  // The weight of the policy's entropy in the values: the temperature, or 0 where there is none.
  Scalar tau() const { return soft ? Given(controls.temperature, temperature.value()) : Scalar{0}; }
  // Whether the policy's loss of this update has its Q term: false during the warm start.
  bool uses_q() const { return this->updates >= config().warm_start_updates(); }
  // Whether this update needs beta+ and beta- at the states of B.
  bool needs_plus() const { return needs_behaviors() || config().munchausen_weight() > 0; }
  bool needs_minus() const { return needs_behaviors() && IsMovedByMinus(config().constraint()); }
  bool needs_behaviors() const { return improves_policy() && config().divergence() != DbrConfig::ACTIONS; }
  // Whether this update improves the policy, the multiplier and the temperature.
  bool improves_policy() const { return (this->updates + 1) % config().updates_per_policy_update() == 0; }

  // The weight of the entropy in the policy's loss, in units of Q.
  double EntropyWeight() const { return soft ? static_cast<double>(tau()) : config().entropy_weight(); }

  // Begins an update.
  void Begin() {
    const double learning_rate = ActorCritic<Scalar>::Begin();
    beta_plus.set_learning_rate(learning_rate);
    beta_minus.set_learning_rate(learning_rate);
  }

  // Fits beta+ and beta- to the transitions of B in D+ and in D-, by the advantages of this update. The
  // likelihoods are those of this struct's beta+ and beta-.
  template <class Likelihood>
  void FitBehaviorsTo(const BasicBatch<Scalar>& batch, Likelihood* plus, Likelihood* minus) {
    partition.Split(this->advantages, static_cast<float>(config().minus_margin()));
    this->runner.Run(
        [&] {
          if (partition.has_plus()) plus->Fit(batch, &partition.plus(), &beta_plus);
        },
        [&] {
          if (partition.has_minus()) minus->Fit(batch, &partition.minus(), &beta_minus);
        });
  }

  // Ends an update. Where it improved the policy, the multiplier and the temperature make a step, unless they
  // are given from outside. During the
  // warm start both stand still, for nothing there answers to them. target_entropy is in nats.
  void Finish(const PolicyLoss<Scalar>& loss, Scalar target_entropy) {
    if (improves_policy() && uses_q()) {
      if (constrained && !controls.multiplier) multiplier.Step(loss.divergence_plus - loss.threshold);
      if (soft && !controls.temperature) temperature.Step(target_entropy - loss.entropy);
    }
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
    // Behaviours without a batch of their own are fitted to B. Their forward passes at s are counted below.
    for (const int behavior : {batch.plus, batch.minus}) {
      if (behavior == 0) flops += shape.ParameterGradientFlops(batch.uniform);
    }
    // At s in each update: pi; where it improves pi: beta+ and beta-, whether the constraint looks at beta-
    // or not, so that what is left out shows as time. At s': the target pi', and beta+ too where the value is
    // penalised.
    const int each = config().value_penalty() && constrained ? 3 : 2;
    const double improving =
        2 * shape.ForwardFlops(batch.uniform) + shape.ParameterGradientFlops(batch.uniform);
    return flops + each * shape.ForwardFlops(batch.uniform) +
           improving / config().updates_per_policy_update();
  }

  static std::vector<UpdateMetric> Metrics() {
    return {{"train/critic_loss"},        {"train/actor_loss"},      {"train/beta_plus_loss"},
            {"train/beta_minus_loss"},    {"train/divergence_plus"}, {"train/divergence_minus"},
            {"train/threshold"},          {"train/multiplier"},      {"train/policy_entropy"},
            {"train/value_mean"},         {"train/target_mean"},     {"train/advantage_mean"},
            {"train/advantage_positive"}, {"train/advantage_std"},   {"train/temperature"}};
  }

  // Sets `metrics`. Returns Internal where a value is not finite.
  absl::Status Report(const FitLosses<Scalar>& fits, const PolicyLoss<Scalar>& loss, Scalar target_mean,
                      std::vector<UpdateMetric>* metrics) const {
    const AdvantageFigures figures = FiguresOf(this->advantages);
    return SetMetrics({fits.critic, loss.loss, fits.beta_plus, fits.beta_minus, loss.divergence_plus,
                       loss.divergence_minus, loss.threshold, alpha(), loss.entropy, loss.value, target_mean,
                       figures.mean, figures.positive, figures.deviation, tau()},
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
    if (soft) temperature.Save(file, kTemperature);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = ActorCritic<Scalar>::Load(file);
    status.Update(beta_plus.Load(kBetaPlus, file));
    status.Update(beta_minus.Load(kBetaMinus, file));
    status.Update(multiplier.Load(file));
    if (soft) status.Update(temperature.Load(file, kTemperature));
    return status;
  }

  TrainedNetwork<Scalar> beta_plus;
  TrainedNetwork<Scalar> beta_minus;
  Multiplier<Scalar> multiplier;
  Multiplier<Scalar> temperature;    // not used unless `soft`
  BatchPartition<Scalar> partition;  // of the newest B, with behavior_data BATCH
  UpdateControls controls;           // of the run's phase
  const bool constrained;
  const bool soft;  // whether the policy's entropy has a temperature

 private:
  static constexpr char kTemperature[] = "log_temperature";

  static Scalar Given(const std::optional<double>& value, Scalar learned) {
    return value.has_value() ? static_cast<Scalar>(*value) : learned;
  }
  // A logarithm must exist where there is no temperature too.
  static double FirstTemperature(const DbrConfig& config) {
    return config.first_temperature() > 0 ? config.first_temperature() : 1;
  }
};

}  // namespace dbr
