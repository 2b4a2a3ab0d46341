#include "nn/policy.h"

#include <limits>

#include "core/check.h"
#include "core/transition.h"
#include "nn/continuous_actor.h"
#include "nn/discrete_actor.h"

namespace dbr {

struct PolicyRunner::State {
  DiscreteActor discrete;
  ContinuousActor continuous;
  const PolicyNetworks* policy = nullptr;  // of the newest Act
  MatrixX<float> observations;             // of the newest Act, normalised where the policy asks for it

  void Take(const PolicyNetworks& networks, const ConstMatrixRef<float>& raw) {
    policy = &networks;
    if (!networks.Normalize(raw, &observations)) observations = raw;
  }
};

PolicyRunner::PolicyRunner() : state_(std::make_unique<State>()) {}
PolicyRunner::~PolicyRunner() = default;

absl::Status PolicyRunner::Act(const PolicyNetworks& policy, ActingMode mode,
                               const ConstMatrixRef<float>& observations, const ConstMatrixRef<float>& masks,
                               Rng& rng, Eigen::Ref<MatrixX<float>> actions) {
  if ((mode == GREEDY_Q || mode == SUPPORT) && !policy.has_critics()) {
    return absl::InvalidArgumentError(
        "acting by Q needs critics and the policy has none: use the mode SAMPLE or MODE");
  }
  state_->Take(policy, observations);
  if (policy.spec().actions.discrete()) {
    return state_->discrete.Act(policy, mode, state_->observations, masks, rng, actions);
  }
  return state_->continuous.Act(policy, mode, state_->observations, rng, actions);
}

void PolicyRunner::Advantages(const ConstMatrixRef<float>& actions, Rng& rng,
                              Eigen::Ref<VectorX<float>> advantages) {
  DBR_CHECK(state_->policy != nullptr);
  if (!state_->policy->has_critics()) {
    advantages.setConstant(kUnjudged);
  } else if (state_->policy->spec().actions.discrete()) {
    state_->discrete.Advantages(actions, advantages);
  } else {
    state_->continuous.Advantages(*state_->policy, state_->observations, actions, rng, advantages);
  }
}

void PolicyRunner::Values(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                          const ConstMatrixRef<float>& masks, Rng& rng, Eigen::Ref<VectorX<float>> values) {
  state_->policy = nullptr;
  if (!policy.has_critics()) {
    values.setConstant(std::numeric_limits<float>::quiet_NaN());
    return;
  }
  if (!policy.Normalize(observations, &state_->observations)) state_->observations = observations;
  if (policy.spec().actions.discrete()) {
    state_->discrete.Values(policy, state_->observations, masks, values);
  } else {
    state_->continuous.Values(policy, state_->observations, rng, values);
  }
}

const PolicyView& PolicyRunner::View(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                                     const ConstMatrixRef<float>& masks) {
  DBR_CHECK(policy.spec().actions.discrete());
  state_->Take(policy, observations);
  return state_->discrete.View(policy, state_->observations, masks);
}

}  // namespace dbr
