#include "learner/algorithms/iql.h"

#include "learner/algorithms/algorithm_adapter.h"
#include "learner/objectives/advantage_weights.h"
#include "learner/objectives/expectile.h"
#include "learner/training/update_metrics.h"

namespace dbr {
namespace {

constexpr char kValue[] = "value";

}  // namespace

template <class Scalar>
Iql<Scalar>::Iql(const AlgorithmSpec& spec)
    : Base({{"train/critic_loss"},
            {"train/value_loss"},
            {"train/actor_loss"},
            {"train/weight_mean"},
            {"train/weight_max"},
            {"train/value_mean"},
            {"train/target_mean"},
            {"train/advantage_mean"},
            {"train/advantage_positive"},
            {"train/advantage_std"}},
           spec),
      value_(MlpShape(spec.observation_size, spec.hidden_sizes, 1),
             networks_.Options(spec, /*with_target=*/false), networks_.rng) {}

template <class Scalar>
absl::Status Iql<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                 const BasicBatch<Scalar>&) {
  value_.set_learning_rate(networks_.Begin());
  const Scalar value_loss = FitValue(uniform);
  const Scalar critic_loss =
      regression_.Fit(uniform, networks_.spec.config.reward_scale(), next_value_, &networks_.critics);
  networks_.SetAdvantages(advantage_);
  AdvantageWeights<Scalar>(advantage_, {config().temperature(), config().max_weight()}, &weights_);
  pi_.Fit(uniform, &weights_, &networks_.policy);
  ++networks_.updates;
  const AdvantageFigures advantages = FiguresOf(networks_.advantages);
  return SetMetrics({critic_loss, value_loss, pi_.loss(), weights_.mean(), weights_.maxCoeff(),
                     (target_value_ - advantage_).mean(), regression_.target().mean(), advantages.mean,
                     advantages.positive, advantages.deviation},
                    networks_.updates, &metrics_);
}

template <class Scalar>
Scalar Iql<Scalar>::FitValue(const BasicBatch<Scalar>& batch) {
  CriticEnsemble<Scalar>& critics = networks_.critics;
  inputs_.resize(batch.observations.rows() + batch.actions.rows(), batch.size());
  inputs_ << batch.observations, batch.actions;
  critics.EvaluateTargets(inputs_);
  target_value_.resize(batch.size());
  MeanOfSmaller<Scalar>(critics.target1(), critics.target2(), &target_value_);
  next_value_ = value_.Evaluate(batch.next_observations).row(0).transpose();
  const MatrixX<Scalar>& value = value_.Forward(batch.observations);
  advantage_ = target_value_ - value.row(0).transpose();
  const Scalar loss = ExpectileError<Scalar>(value, target_value_, config().expectile(), &d_value_);
  value_.Step(batch.observations, d_value_);
  return loss;
}

template <class Scalar>
double Iql<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  const MlpShape &policy = networks_.policy.shape(), &value = value_.shape();
  return critics.TargetFlops(n) + critics.FitFlops(n) + policy.ForwardFlops(n) +
         policy.ParameterGradientFlops(n) + 2 * value.ForwardFlops(n) + value.ParameterGradientFlops(n);
}

template <class Scalar>
void Iql<Scalar>::Save(TensorFile* file) const {
  networks_.Save(file);
  value_.Save(kValue, file);
}

template <class Scalar>
absl::Status Iql<Scalar>::Load(const TensorFile& file) {
  absl::Status status = networks_.Load(file);
  status.Update(value_.Load(kValue, file));
  return status;
}

template class Iql<float>;
template class Iql<double>;

std::unique_ptr<Algorithm> MakeIql(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<Iql>>(spec);
}

}  // namespace dbr
