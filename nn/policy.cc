#include "nn/policy.h"

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "nn/categorical.h"
#include "nn/mlp.h"

namespace dbr {
namespace {

MlpShape ShapeOf(const PolicySpec& spec) {
  return MlpShape(spec.observation_size, spec.hidden_sizes, spec.actions.size);
}

absl::Status CheckSpec(const PolicySpec& spec) {
  if (!spec.actions.discrete()) {
    return absl::InvalidArgumentError("action space: expected a discrete one, found a continuous one");
  }
  if (spec.observation_size <= 0 || spec.actions.size <= 0) {
    return absl::InvalidArgumentError(absl::StrCat("expected sizes above 0, found observation_size ",
                                                   spec.observation_size, " and ", spec.actions.size,
                                                   " actions"));
  }
  for (const int size : spec.hidden_sizes) {
    if (size <= 0)
      return absl::InvalidArgumentError(absl::StrCat("hidden_sizes: expected above 0, found ", size));
  }
  return absl::OkStatus();
}

int Argmax(const MatrixX<float>& values, const ConstMatrixRef<float>& masks, Eigen::Index j) {
  int best = -1;
  for (int k = 0; k < values.rows(); ++k) {
    if (masks(k, j) > 0 && (best < 0 || values(k, j) > values(best, j))) best = k;
  }
  return best;
}

int Draw(const MatrixX<float>& probabilities, const ConstMatrixRef<float>& masks, Eigen::Index j, Rng& rng) {
  float remaining = static_cast<float>(rng.Uniform());
  int last_legal = -1;
  for (int k = 0; k < probabilities.rows(); ++k) {
    if (masks(k, j) <= 0) continue;
    last_legal = k;
    remaining -= probabilities(k, j);
    if (remaining < 0) break;
  }
  return last_legal;
}

// Greatest Q among the actions with beta+ >= max(eps, beta-), else greatest beta+ / beta-
// (docs/algorithms.md, DBR).
int SupportAction(const PolicyView& view, const ConstMatrixRef<float>& masks, float epsilon, Eigen::Index j) {
  int best = -1, fallback = -1;
  float best_ratio = -1;
  for (int k = 0; k < view.q.rows(); ++k) {
    if (masks(k, j) <= 0) continue;
    const float plus = view.beta_plus(k, j), minus = view.beta_minus(k, j);
    if (plus >= std::max(epsilon, minus) && (best < 0 || view.q(k, j) > view.q(best, j))) best = k;
    const float ratio = plus / std::max(minus, std::numeric_limits<float>::min());
    if (ratio > best_ratio) {
      best_ratio = ratio;
      fallback = k;
    }
  }
  return best >= 0 ? best : fallback;
}

}  // namespace

absl::StatusOr<std::shared_ptr<const PolicyNetworks>> PolicyNetworks::Create(PolicySnapshot snapshot) {
  if (absl::Status status = CheckSpec(snapshot.spec); !status.ok()) return status;
  const auto expected = static_cast<std::size_t>(ShapeOf(snapshot.spec).parameter_count());
  if (snapshot.Find(kPolicyNetwork) == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("network '", kPolicyNetwork, "' is missing from the policy"));
  }
  for (const auto& [name, parameters] : snapshot.networks) {
    if (parameters.size() != expected) {
      return absl::InvalidArgumentError(absl::StrCat("network '", name, "': expected ", expected,
                                                     " parameters for its sizes, found ", parameters.size()));
    }
  }
  return std::shared_ptr<const PolicyNetworks>(new PolicyNetworks(std::move(snapshot)));
}

bool PolicyNetworks::has_critics() const {
  return snapshot_.Find(kCritic1) != nullptr && snapshot_.Find(kCritic2) != nullptr;
}

bool PolicyNetworks::has_behavior() const {
  return snapshot_.Find(kBetaPlus) != nullptr && snapshot_.Find(kBetaMinus) != nullptr;
}

struct PolicyRunner::State {
  MlpActivations<float> activations;
  Categorical<float> distribution;
  PolicyView view;

  // [actions x n] outputs of a network of the policy.
  const MatrixX<float>& Run(const PolicyNetworks& policy, const char* name,
                            const ConstMatrixRef<float>& observations) {
    const std::vector<float>* parameters = policy.snapshot().Find(name);
    DBR_CHECK(parameters != nullptr);
    return MlpForward(ShapeOf(policy.spec()), parameters->data(), observations, &activations);
  }
  void RunCategorical(const PolicyNetworks& policy, const char* name,
                      const ConstMatrixRef<float>& observations, const ConstMatrixRef<float>& masks,
                      MatrixX<float>* probabilities) {
    MaskedSoftmax<float>(Run(policy, name, observations), masks, &distribution);
    probabilities->swap(distribution.probabilities);
  }
  void RunCritics(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations) {
    if (policy.has_critics()) {
      view.q = Run(policy, kCritic1, observations);
      view.q = view.q.cwiseMin(Run(policy, kCritic2, observations));
    } else {
      view.q.resize(0, 0);
    }
  }
  void RunBehavior(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                   const ConstMatrixRef<float>& masks) {
    if (policy.has_behavior()) {
      RunCategorical(policy, kBetaPlus, observations, masks, &view.beta_plus);
      RunCategorical(policy, kBetaMinus, observations, masks, &view.beta_minus);
    } else {
      view.beta_plus.resize(0, 0);
      view.beta_minus.resize(0, 0);
    }
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
  if (mode == SUPPORT && !policy.has_behavior()) {
    return absl::InvalidArgumentError(
        "the mode SUPPORT needs beta+ and beta- and the policy has none: use another mode");
  }
  PolicyView& view = state_->view;
  state_->RunCategorical(policy, kPolicyNetwork, observations, masks, &view.policy);
  state_->RunCritics(policy, observations);
  if (mode == SUPPORT) state_->RunBehavior(policy, observations, masks);
  if (!view.policy.allFinite() || !view.q.allFinite()) {
    return absl::InternalError(absl::StrCat("policy version ", policy.snapshot().version,
                                            " gives values that are not finite. Use an earlier checkpoint."));
  }
  for (Eigen::Index j = 0; j < observations.cols(); ++j) {
    switch (mode) {
      case SAMPLE:
        actions(0, j) = static_cast<float>(Draw(view.policy, masks, j, rng));
        break;
      case MODE:
        actions(0, j) = static_cast<float>(Argmax(view.policy, masks, j));
        break;
      case GREEDY_Q:
        actions(0, j) = static_cast<float>(Argmax(view.q, masks, j));
        break;
      case SUPPORT:
        actions(0, j) = static_cast<float>(SupportAction(view, masks, policy.snapshot().support_epsilon, j));
        break;
    }
  }
  return absl::OkStatus();
}

void PolicyRunner::Advantages(const ConstMatrixRef<float>& actions, Eigen::Ref<VectorX<float>> advantages) {
  const PolicyView& view = state_->view;
  if (view.q.size() == 0) {
    advantages.setConstant(kUnjudged);
    return;
  }
  for (Eigen::Index j = 0; j < actions.cols(); ++j) {
    const auto a = static_cast<Eigen::Index>(actions(0, j));
    advantages[j] = view.q(a, j) - view.policy.col(j).dot(view.q.col(j));
  }
}

const PolicyView& PolicyRunner::View(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                                     const ConstMatrixRef<float>& masks) {
  state_->RunCategorical(policy, kPolicyNetwork, observations, masks, &state_->view.policy);
  state_->RunCritics(policy, observations);
  state_->RunBehavior(policy, observations, masks);
  return state_->view;
}

}  // namespace dbr
