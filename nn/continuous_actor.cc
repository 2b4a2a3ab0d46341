#include "nn/continuous_actor.h"

#include <cmath>

#include "nn/keep_nan.h"
#include "nn/not_finite.h"

namespace dbr {

void ContinuousActor::Evaluate(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations) {
  head_.Split(policy.Run(kPolicyNetwork, observations, &policy_activations_), kPolicyLogStd);
}

absl::Status ContinuousActor::Act(const PolicyNetworks& policy, ActingMode mode,
                                  const ConstMatrixRef<float>& observations, Rng& rng,
                                  Eigen::Ref<MatrixX<float>> actions) {
  if (mode == SUPPORT) {
    return absl::InvalidArgumentError(
        "the mode SUPPORT serves discrete actions alone: use SAMPLE, MODE or GREEDY_Q");
  }
  Evaluate(policy, observations);
  if (!head_.mean().allFinite() || !head_.log_std().allFinite()) return NotFiniteError(policy.snapshot());
  if (mode == MODE) {
    actions = head_.mean().array().tanh().matrix();
  } else if (mode == SAMPLE) {
    Sample(1, rng);
    actions = actions_;
  } else {
    return ChooseGreedy(policy, observations, rng, actions);
  }
  return absl::OkStatus();
}

void ContinuousActor::Sample(Eigen::Index count, Rng& rng) {
  const MatrixX<float>& mean = head_.mean();
  actions_.resize(mean.rows(), count * mean.cols());
  for (Eigen::Index j = 0; j < actions_.cols(); ++j) {
    const Eigen::Index state = j % mean.cols();
    for (Eigen::Index d = 0; d < mean.rows(); ++d) {
      const float noise = static_cast<float>(rng.Normal());
      actions_(d, j) = std::tanh(mean(d, state) + std::exp(head_.log_std()(d, state)) * noise);
    }
  }
}

const MatrixX<float>& ContinuousActor::Critic(const PolicyNetworks& policy, const char* name,
                                              const ConstMatrixRef<float>& observations,
                                              const ConstMatrixRef<float>& actions) {
  const Eigen::Index n = observations.cols();
  inputs_.resize(observations.rows() + actions.rows(), actions.cols());
  for (Eigen::Index first = 0; first < actions.cols(); first += n) {
    inputs_.block(0, first, observations.rows(), n) = observations;
  }
  inputs_.bottomRows(actions.rows()) = actions;
  return policy.Run(name, inputs_, &critic_activations_);
}

absl::Status ContinuousActor::ChooseGreedy(const PolicyNetworks& policy,
                                           const ConstMatrixRef<float>& observations, Rng& rng,
                                           Eigen::Ref<MatrixX<float>> actions) {
  Sample(kGreedySamples, rng);
  const MatrixX<float>& q = Critic(policy, kCritic1, observations, actions_);
  if (!q.allFinite()) return NotFiniteError(policy.snapshot());
  const Eigen::Index n = observations.cols();
  for (Eigen::Index j = 0; j < n; ++j) {
    Eigen::Index best = j;
    for (Eigen::Index k = j; k < q.cols(); k += n) {
      if (q(0, k) > q(0, best)) best = k;
    }
    actions.col(j) = actions_.col(best);
  }
  return absl::OkStatus();
}

void ContinuousActor::EvaluateSmaller(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                                      const ConstMatrixRef<float>& actions) {
  values_ = Critic(policy, kCritic1, observations, actions).row(0);
  values_ = EachSmallerOrNan(values_, Critic(policy, kCritic2, observations, actions).row(0).transpose());
}

void ContinuousActor::MeanValue(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                                Rng& rng, Eigen::Ref<VectorX<float>> values) {
  Sample(kValueSamples, rng);
  EvaluateSmaller(policy, observations, actions_);
  const Eigen::Index n = observations.cols();
  values.setZero();
  for (Eigen::Index k = 0; k < kValueSamples; ++k) values += values_.segment(k * n, n);
  values /= static_cast<float>(kValueSamples);
}

void ContinuousActor::Advantages(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                                 const ConstMatrixRef<float>& actions, Rng& rng,
                                 Eigen::Ref<VectorX<float>> advantages) {
  MeanValue(policy, observations, rng, advantages);
  EvaluateSmaller(policy, observations, actions);
  advantages = values_ - advantages;
}

void ContinuousActor::Values(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                             Rng& rng, Eigen::Ref<VectorX<float>> values) {
  Evaluate(policy, observations);
  MeanValue(policy, observations, rng, values);
}

}  // namespace dbr
