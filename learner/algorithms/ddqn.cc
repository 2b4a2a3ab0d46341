#include "learner/algorithms/ddqn.h"

#include <type_traits>

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/objectives/critic_target.h"
#include "learner/objectives/discrete_losses.h"
#include "learner/training/learning_rate.h"
#include "learner/training/policy_export.h"
#include "learner/training/update_metrics.h"

namespace dbr {

template <class Scalar>
Ddqn<Scalar>::Ddqn(const AlgorithmSpec& spec)
    : spec_(spec),
      init_rng_(spec.seed),
      network_(MlpShape(spec.observation_size, spec.hidden_sizes, spec.actions.size),
               {.learning_rate = spec.config.learning_rate(),
                .with_target = true,
                .bfloat16 = std::is_same_v<Scalar, float> && spec.bfloat16},
               init_rng_),
      metrics_{{"train/critic_loss"},    {"train/value_mean"},         {"train/target_mean"},
               {"train/advantage_mean"}, {"train/advantage_positive"}, {"train/advantage_std"}} {}

template <class Scalar>
absl::Status Ddqn<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                  const BasicBatch<Scalar>&) {
  network_.set_learning_rate(LearningRate(spec_.config, updates_));
  network_.set_target_tau(spec_.config.target_tau());
  ComputeTarget(uniform);
  const MatrixX<Scalar>& q = network_.Forward(uniform.observations);
  const Scalar loss = CriticLoss<Scalar>(q, uniform.actions, target_, &d_q_);
  GreedyValue<Scalar>(q, q, uniform.masks, &value_);
  ComputeAdvantages<Scalar>(q, q, uniform.actions, value_, &advantages_);
  network_.Step(uniform.observations, d_q_);
  ++updates_;
  const AdvantageFigures advantages = FiguresOf(advantages_);
  return SetMetrics(
      {loss, value_.mean(), target_.mean(), advantages.mean, advantages.positive, advantages.deviation},
      updates_, &metrics_);
}

template <class Scalar>
void Ddqn<Scalar>::ComputeTarget(const BasicBatch<Scalar>& batch) {
  next_q_ = network_.Evaluate(batch.next_observations);
  GreedyValue<Scalar>(next_q_, network_.ForwardTarget(batch.next_observations), batch.next_masks,
                      &next_value_);
  CriticTarget(batch, spec_.config.reward_scale(), next_value_, &target_);
}

template <class Scalar>
double Ddqn<Scalar>::UpdateFlops() const {
  const Eigen::Index n = needs().uniform;
  return 3 * network_.shape().ForwardFlops(n) + network_.shape().ParameterGradientFlops(n);
}

template <class Scalar>
void Ddqn<Scalar>::ExportPolicy(PolicySnapshot* snapshot) const {
  BeginExport(spec_, snapshot);
  for (const char* name : {kPolicyNetwork, kCritic1, kCritic2})
    ExportNetwork(name, network_.parameters(), snapshot);
}

template <class Scalar>
void Ddqn<Scalar>::Save(TensorFile* file) const {
  network_.Save(kPolicyNetwork, file);
  PutCounter("ddqn.updates", updates_, file);
}

template <class Scalar>
absl::Status Ddqn<Scalar>::Load(const TensorFile& file) {
  absl::Status status = network_.Load(kPolicyNetwork, file);
  status.Update(GetCounter("ddqn.updates", file, &updates_));
  return status;
}

template class Ddqn<float>;
template class Ddqn<double>;

std::unique_ptr<Algorithm> MakeDdqn(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Ddqn>>(spec);
}

}  // namespace dbr
