#include "nn/discrete_actor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "nn/keep_nan.h"
#include "nn/not_finite.h"

namespace dbr {
namespace {

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

void DiscreteActor::RunCategorical(const PolicyNetworks& policy, const char* name,
                                   const ConstMatrixRef<float>& observations,
                                   const ConstMatrixRef<float>& masks, MatrixX<float>* probabilities) {
  MaskedSoftmax<float>(policy.Run(name, observations, &activations_), masks, &distribution_);
  probabilities->swap(distribution_.probabilities);
}

void DiscreteActor::RunCritics(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations) {
  if (policy.has_critics()) {
    view_.q = policy.Run(kCritic1, observations, &critic_activations_);
    view_.q = EachSmallerOrNan(view_.q, policy.Run(kCritic2, observations, &critic_activations_));
  } else {
    view_.q.resize(0, 0);
  }
}

void DiscreteActor::RunDualBehavior(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                                    const ConstMatrixRef<float>& masks) {
  if (policy.has_dual_behavior()) {
    RunCategorical(policy, kBetaPlus, observations, masks, &view_.beta_plus);
    RunCategorical(policy, kBetaMinus, observations, masks, &view_.beta_minus);
  } else {
    view_.beta_plus.resize(0, 0);
    view_.beta_minus.resize(0, 0);
  }
}

absl::Status DiscreteActor::Act(const PolicyNetworks& policy, ActingMode mode,
                                const ConstMatrixRef<float>& observations, const ConstMatrixRef<float>& masks,
                                Rng& rng, Eigen::Ref<MatrixX<float>> actions) {
  if (mode == SUPPORT && !policy.has_dual_behavior()) {
    return absl::InvalidArgumentError(
        "the mode SUPPORT needs beta+ and beta- and the policy has none: use another mode");
  }
  RunCategorical(policy, kPolicyNetwork, observations, masks, &view_.policy);
  RunCritics(policy, observations);
  bool finite = view_.policy.allFinite() && view_.q.allFinite();
  if (mode == SUPPORT) {
    RunDualBehavior(policy, observations, masks);
    finite = finite && view_.beta_plus.allFinite() && view_.beta_minus.allFinite();
  }
  if (!finite) return NotFiniteError(policy.snapshot());
  for (Eigen::Index j = 0; j < observations.cols(); ++j) {
    switch (mode) {
      case SAMPLE:
        actions(0, j) = static_cast<float>(Draw(view_.policy, masks, j, rng));
        break;
      case MODE:
        actions(0, j) = static_cast<float>(Argmax(view_.policy, masks, j));
        break;
      case GREEDY_Q:
        actions(0, j) = static_cast<float>(Argmax(view_.q, masks, j));
        break;
      case SUPPORT:
        actions(0, j) = static_cast<float>(SupportAction(view_, masks, policy.snapshot().support_epsilon, j));
        break;
    }
  }
  return absl::OkStatus();
}

void DiscreteActor::Advantages(const ConstMatrixRef<float>& actions,
                               Eigen::Ref<VectorX<float>> advantages) const {
  for (Eigen::Index j = 0; j < actions.cols(); ++j) {
    const auto a = static_cast<Eigen::Index>(actions(0, j));
    advantages[j] = view_.q(a, j) - view_.policy.col(j).dot(view_.q.col(j));
  }
}

void DiscreteActor::Values(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                           const ConstMatrixRef<float>& masks, Eigen::Ref<VectorX<float>> values) {
  RunCategorical(policy, kPolicyNetwork, observations, masks, &view_.policy);
  RunCritics(policy, observations);
  values = view_.policy.cwiseProduct(view_.q).colwise().sum().transpose();
}

const PolicyView& DiscreteActor::View(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                                      const ConstMatrixRef<float>& masks) {
  RunCategorical(policy, kPolicyNetwork, observations, masks, &view_.policy);
  RunCritics(policy, observations);
  RunDualBehavior(policy, observations, masks);
  if (policy.has_behavior()) {
    RunCategorical(policy, kBehavior, observations, masks, &view_.beta);
  } else {
    view_.beta.resize(0, 0);
  }
  return view_;
}

}  // namespace dbr
