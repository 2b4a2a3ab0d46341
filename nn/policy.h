// A policy ready to act: networks rebuilt from a snapshot, evaluated for many environments at once.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "core/batch.h"
#include "core/policy_snapshot.h"
#include "core/rng.h"
#include "proto/config.pb.h"

namespace dbr {

// Immutable; shared by pointer between threads. Holds the snapshot that it was made from.
class PolicyNetworks {
 public:
  // InvalidArgument where a network is missing or its parameters are not as many as the spec asks; names the
  // network.
  static absl::StatusOr<std::shared_ptr<const PolicyNetworks>> Create(PolicySnapshot snapshot);

  const PolicySnapshot& snapshot() const { return snapshot_; }
  const PolicySpec& spec() const { return snapshot_.spec; }
  bool has_critics() const;
  bool has_behavior() const;  // beta+ and beta-

 private:
  explicit PolicyNetworks(PolicySnapshot snapshot) : snapshot_(std::move(snapshot)) {}
  PolicySnapshot snapshot_;
};

// Everything that the networks say of n observations; [actions x n] each, empty where the snapshot lacks the
// network. Probabilities of illegal actions are 0; Q of illegal actions is meaningless.
struct PolicyView {
  MatrixX<float> policy;
  MatrixX<float> beta_plus;
  MatrixX<float> beta_minus;
  MatrixX<float> q;  // the smaller of the twins
};

// Workspaces for one thread; allocates only when a batch is larger than any before.
class PolicyRunner {
 public:
  PolicyRunner();
  ~PolicyRunner();

  // Chooses an action for each of n columns: observations [observation x n], masks [actions x n], actions
  // [width x n]. InvalidArgument where `mode` needs networks that the snapshot lacks. A NaN Q or probability
  // gives Internal.
  absl::Status Act(const PolicyNetworks& policy, ActingMode mode,
                   const Eigen::Ref<const MatrixX<float>>& observations,
                   const Eigen::Ref<const MatrixX<float>>& masks, Rng& rng,
                   Eigen::Ref<MatrixX<float>> actions);

  // After Act: A = Q(s, a) - V(s) of given actions (ALGORITHMS: DBR, step 6), Q the smaller twin, V its mean
  // under pi. [n]; the actions may be others than Act's (exploration). NaN (not yet judged) where the
  // snapshot has no critics.
  void Advantages(const Eigen::Ref<const MatrixX<float>>& actions, Eigen::Ref<VectorX<float>> advantages);

  // All of the networks' outputs, for probing.
  const PolicyView& View(const PolicyNetworks& policy, const Eigen::Ref<const MatrixX<float>>& observations,
                         const Eigen::Ref<const MatrixX<float>>& masks);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dbr
