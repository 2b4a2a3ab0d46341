#include "learner/algorithms/cal_ql.h"

#include <cmath>
#include <utility>

#include "learner/algorithms/algorithm_adapter.h"

namespace dbr {
namespace {

std::vector<UpdateMetric> MetricsOfCalQl(std::vector<UpdateMetric> metrics) {
  metrics.push_back({"train/conservative_gap"});
  return metrics;
}

}  // namespace

template <class Scalar>
CalQl<Scalar>::CalQl(const AlgorithmSpec& spec)
    : Base(MetricsOfCalQl(SoftNetworks<Scalar>::Metrics()), spec, spec.config.cal_ql()),
      target_entropy_(static_cast<Scalar>(spec.config.cal_ql().target_entropy() * spec.actions.size)) {}

template <class Scalar>
absl::Status CalQl<Scalar>::Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>&,
                                   const BasicBatch<Scalar>&) {
  networks_.Begin();
  EvaluatePolicy(uniform);
  DrawActions(uniform.size());
  const Scalar critic_loss = FitCritics(uniform);
  const SoftPolicyLoss<Scalar> policy_loss = ImprovePolicy(uniform);
  networks_.Finish(policy_loss, target_entropy_);
  networks_.SetAdvantages(regression_.behavior_value() - value_);
  return networks_.Report(critic_loss, policy_loss, regression_.target().mean(), &metrics_,
                          {regression_.gap()});
}

template <class Scalar>
void CalQl<Scalar>::EvaluatePolicy(const BasicBatch<Scalar>& batch) {
  networks_.runner.Run(
      [&] { next_head_.Split(networks_.policy.Evaluate(batch.next_observations), kPolicyLogStd); },
      [&] { head_.Split(networks_.policy.Forward(batch.observations), kPolicyLogStd); });
}

template <class Scalar>
void CalQl<Scalar>::DrawActions(Eigen::Index n) {
  const Eigen::Index dimensions = networks_.spec.actions.size, each = config().conservative_actions() * n;
  conservative_.actions.resize(dimensions, 3 * each);
  conservative_.log_prob.resize(3 * each);
  conservative_.unbounded = each;
  for (Eigen::Index j = 0; j < each; ++j) {
    for (Eigen::Index i = 0; i < dimensions; ++i) {
      conservative_.actions(i, j) = static_cast<Scalar>(2 * networks_.rng.Uniform() - 1);
    }
  }
  conservative_.log_prob.head(each).setConstant(static_cast<Scalar>(-std::log(2.0) * dimensions));
  Eigen::Index first = each;
  for (const GaussianHead<Scalar>* head : {&head_, &next_head_}) {
    FillNormal(networks_.rng, dimensions, each, &conservative_noise_);
    conservative_draws_.Draw(*head, conservative_noise_);
    conservative_.actions.middleCols(first, each) = conservative_draws_.sample().action;
    conservative_.log_prob.segment(first, each) = conservative_draws_.sample().log_prob;
    first += each;
  }
}

template <class Scalar>
Scalar CalQl<Scalar>::FitCritics(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  FillNormal(networks_.rng, networks_.spec.actions.size, n, &noise_);
  next_draws_.DrawActions(next_head_, noise_);
  networks_.critics.EvaluateTargets(next_draws_.CriticInput(batch.next_observations));
  next_value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.target1(), networks_.critics.target2(), &next_value_);
  return regression_.Fit(batch, networks_.spec.config.reward_scale(), next_value_, conservative_,
                         {config().conservative_weight(), config().calibrated()}, &networks_.critics);
}

template <class Scalar>
SoftPolicyLoss<Scalar> CalQl<Scalar>::ImprovePolicy(const BasicBatch<Scalar>& batch) {
  const Eigen::Index n = batch.size();
  FillNormal(networks_.rng, networks_.spec.actions.size, n, &noise_);
  const SoftPolicyLoss<Scalar> loss = objective_.Compute(
      head_, batch.observations, noise_, networks_.temperature.value(), &networks_.critics, &d_output_);
  networks_.policy.Step(batch.observations, d_output_);
  value_.resize(n);
  MeanOfSmaller<Scalar>(networks_.critics.value1(), networks_.critics.value2(), &value_);
  return loss;
}

template <class Scalar>
double CalQl<Scalar>::UpdateFlops() const {
  const Eigen::Index n = this->needs().uniform;
  const CriticEnsemble<Scalar>& critics = networks_.critics;
  return networks_.UpdateFlops(n) + critics.FitFlops(3 * config().conservative_actions() * n) +
         critics.TargetFlops(n) + critics.FirstInputGradientFlops(n);
}

template class CalQl<float>;
template class CalQl<double>;

std::unique_ptr<Algorithm> MakeCalQl(const AlgorithmSpec& spec) {
  return std::make_unique<AlgorithmAdapter<CalQl>>(spec);
}

}  // namespace dbr
