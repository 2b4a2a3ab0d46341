// What DBR over discrete and over continuous actions share: the batches that it needs, the options and the
// results of its policy loss, and the constraint's threshold. BEAR uses the same options; its constraint is
// FIXED.
#pragma once

#include "learner/algorithm.h"
#include "learner/objectives/action_weights.h"
#include "proto/config.pb.h"

namespace dbr {

// Whether beta+ is fitted by self-imitation, to transitions that did better than V(s) and in a step of its
// own, instead of to D+.
inline bool ImitatesItself(const DbrConfig& config) {
  return config.advantage() == DbrConfig::SIL;
}

// The batches of one update: B from D for the critics and the policy, B+ and B- for the behaviour policies
// unless these are fitted to B too.
inline BatchNeeds DualBehaviorNeeds(const AlgorithmConfig& config) {
  const int batch = static_cast<int>(config.batch_size());
  const int behavior =
      config.dbr().behavior_batch_size() > 0 ? static_cast<int>(config.dbr().behavior_batch_size()) : batch;
  if (config.dbr().behavior_data() == DbrConfig::BATCH) return {.uniform = batch};
  return {.uniform = batch, .plus = ImitatesItself(config.dbr()) ? 0 : behavior, .minus = behavior};
}

struct PolicyLossOptions {
  DbrConfig::Constraint constraint = DbrConfig::DYNAMIC_MAX;
  DbrConfig::Divergence divergence = DbrConfig::KL;
  double epsilon = 0.05;
  double mmd_sigma = 1;
  bool repel_negative = false;
  double max_repulsion = 0;  // the largest D(pi, beta-) of a state that counts; 0 for no limit
  bool normalize_q = false;
  double entropy_weight = 0;     // of the policy's entropy in nats, in units of Q
  bool use_q = true;             // false during the warm start: neither Q nor the entropy is in the loss
  ActionWeighting actions = {};  // with divergence ACTIONS

  // Whether the repulsion from beta- has a limit.
  bool limits_repulsion() const { return repel_negative && max_repulsion > 0; }

  static PolicyLossOptions Of(const DbrConfig& config) {
    return {.constraint = config.constraint(),
            .divergence = config.divergence(),
            .epsilon = config.epsilon(),
            .mmd_sigma = config.mmd_sigma(),
            .repel_negative = config.repel_negative(),
            .max_repulsion = config.max_repulsion(),
            .normalize_q = config.normalize_q(),
            .entropy_weight = config.entropy_weight(),
            .use_q = config.warm_start_updates() == 0,
            .actions = ActionWeighting::Of(config)};
  }
  static PolicyLossOptions Of(const BearConfig& config) {
    return {.constraint = DbrConfig::FIXED,
            .divergence = config.divergence(),
            .epsilon = config.epsilon(),
            .mmd_sigma = config.mmd_sigma(),
            .entropy_weight = config.entropy_weight(),
            .use_q = config.warm_start_updates() == 0};
  }
};

// The results of a policy loss with a constraint D(pi, beta) <= c on one behaviour policy.
template <class Scalar>
struct ConstrainedLoss {
  Scalar loss = 0;        // the objective with alpha as a constant
  Scalar value = 0;       // E[min_i E_pi Q_i(s, a)]
  Scalar divergence = 0;  // mean D(pi, beta)
  Scalar threshold = 0;   // c
  Scalar entropy = 0;     // mean, nats
};

template <class Scalar>
struct PolicyLoss {
  Scalar loss = 0;             // the objective with alpha as a constant
  Scalar value = 0;            // E[min_i E_pi Q_i(s, a)]
  Scalar divergence_plus = 0;  // mean D(pi, beta+)
  // Mean D(pi, beta-), or D(pi, D-) with the divergence ACTIONS, or else 0 unless it can move the threshold
  // (IsMovedByMinus).
  Scalar divergence_minus = 0;
  Scalar threshold = 0;  // c; 0 without a constraint
  Scalar entropy = 0;    // mean, nats
};

// Whether the threshold depends on D(pi, beta-). Where it does not, beta- is not evaluated at the states of
// the batch.
inline bool IsMovedByMinus(DbrConfig::Constraint constraint) {
  return constraint == DbrConfig::DYNAMIC_MAX || constraint == DbrConfig::DYNAMIC_MIN;
}

template <class Scalar>
struct Threshold {
  Scalar value = 0;             // c
  bool moved_by_minus = false;  // c is D(pi, beta-), not eps
};

// Returns the threshold c of the constraint D(pi, beta+) <= c, given the batch's mean divergence from beta-.
// c is max(eps, D-), as the paper prints it, or min(eps, D-), or eps alone (docs/algorithms.md, DBR step 3).
// Without a constraint it is 0 and has no use.
template <class Scalar>
Threshold<Scalar> ThresholdOf(DbrConfig::Constraint constraint, Scalar epsilon, Scalar divergence_minus) {
  const bool moved = (constraint == DbrConfig::DYNAMIC_MAX && divergence_minus > epsilon) ||
                     (constraint == DbrConfig::DYNAMIC_MIN && divergence_minus < epsilon);
  if (constraint == DbrConfig::NONE) return {};
  return {moved ? divergence_minus : epsilon, moved};
}

}  // namespace dbr
