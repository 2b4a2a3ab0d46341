#include "nn/policy_networks.h"

#include "absl/strings/str_cat.h"
#include "core/check.h"

namespace dbr {
namespace {

absl::Status CheckSpec(const PolicySpec& spec) {
  if (spec.observation_size <= 0 || spec.actions.size <= 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("expected sizes above 0, found observation_size ", spec.observation_size, " and ",
                     spec.actions.size, spec.actions.discrete() ? " actions" : " action dimensions"));
  }
  for (const int size : spec.hidden_sizes) {
    if (size <= 0)
      return absl::InvalidArgumentError(absl::StrCat("hidden_sizes: expected above 0, found ", size));
  }
  return absl::OkStatus();
}

}  // namespace

MlpShape PolicyShape(const PolicySpec& spec) {
  const int outputs = spec.actions.discrete() ? spec.actions.size : 2 * spec.actions.size;
  return MlpShape(spec.observation_size, spec.hidden_sizes, outputs);
}

MlpShape CriticShape(const PolicySpec& spec) {
  const bool discrete = spec.actions.discrete();
  return MlpShape(spec.observation_size + (discrete ? 0 : spec.actions.size), spec.hidden_sizes,
                  discrete ? spec.actions.size : 1, spec.critic_layer_norm);
}

absl::StatusOr<std::shared_ptr<const PolicyNetworks>> PolicyNetworks::Create(PolicySnapshot snapshot) {
  if (absl::Status status = CheckSpec(snapshot.spec); !status.ok()) return status;
  if (snapshot.Find(kPolicyNetwork) == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("network '", kPolicyNetwork, "' is missing from the policy"));
  }
  const std::shared_ptr<const PolicyNetworks> policy(new PolicyNetworks(std::move(snapshot)));
  for (const auto& [name, parameters] : policy->snapshot_.networks) {
    Eigen::Index expected = policy->ShapeOf(name).parameter_count();
    if (name == kObservationNormalizer) expected = 2 * policy->spec().observation_size;
    if (parameters.size() == static_cast<std::size_t>(expected)) continue;
    return absl::InvalidArgumentError(absl::StrCat("network '", name, "': expected ", expected,
                                                   " parameters for its sizes, found ", parameters.size()));
  }
  return policy;
}

PolicyNetworks::PolicyNetworks(PolicySnapshot snapshot)
    : snapshot_(std::move(snapshot)),
      policy_shape_(PolicyShape(snapshot_.spec)),
      critic_shape_(CriticShape(snapshot_.spec)) {}

const MlpShape& PolicyNetworks::ShapeOf(absl::string_view network) const {
  return network == kCritic1 || network == kCritic2 ? critic_shape_ : policy_shape_;
}

const MatrixX<float>& PolicyNetworks::Run(absl::string_view network, const ConstMatrixRef<float>& x,
                                          MlpActivations<float>* activations) const {
  const std::vector<float>* parameters = snapshot_.Find(network);
  DBR_CHECK(parameters != nullptr);
  return MlpForward<float>(ShapeOf(network), parameters->data(), x, activations);
}

bool PolicyNetworks::has_critics() const {
  return snapshot_.Find(kCritic1) != nullptr && snapshot_.Find(kCritic2) != nullptr;
}

bool PolicyNetworks::has_dual_behavior() const {
  return snapshot_.Find(kBetaPlus) != nullptr && snapshot_.Find(kBetaMinus) != nullptr;
}

bool PolicyNetworks::has_behavior() const {
  return snapshot_.Find(kBehavior) != nullptr;
}

bool PolicyNetworks::Normalize(const ConstMatrixRef<float>& observations, MatrixX<float>* normalized) const {
  const std::vector<float>* statistics = snapshot_.Find(kObservationNormalizer);
  if (statistics == nullptr) return false;
  const Eigen::Index size = spec().observation_size;
  const Eigen::Map<const VectorX<float>> mean(statistics->data(), size),
      scale(statistics->data() + size, size);
  *normalized = ((observations.colwise() - mean).array().colwise() * scale.array()).matrix();
  return true;
}

}  // namespace dbr
