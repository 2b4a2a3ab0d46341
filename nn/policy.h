// Acting by a policy's networks, for many environments at once.
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "core/batch.h"
#include "core/rng.h"
#include "nn/policy_networks.h"
#include "proto/config.pb.h"

namespace dbr {

// Everything that the networks of a policy over discrete actions say of n observations; [actions x n] each,
// empty where the snapshot lacks the network. Probabilities of illegal actions are 0; Q of illegal actions is
// meaningless.
struct PolicyView {
  MatrixX<float> policy;
  MatrixX<float> beta_plus;
  MatrixX<float> beta_minus;
  MatrixX<float> beta;  // of an algorithm with one behaviour policy
  MatrixX<float> q;     // the smaller of the twins
};

// Workspaces for one thread; allocates only when a batch is larger than any before.
class PolicyRunner {
 public:
  PolicyRunner();
  ~PolicyRunner();

  // Chooses an action for each of n columns: observations [observation x n], masks [mask width x n], actions
  // [width x n]. InvalidArgument where `mode` needs networks that the snapshot lacks, or another action
  // space. A NaN Q or probability gives Internal.
  absl::Status Act(const PolicyNetworks& policy, ActingMode mode, const ConstMatrixRef<float>& observations,
                   const ConstMatrixRef<float>& masks, Rng& rng, Eigen::Ref<MatrixX<float>> actions);

  // After Act, for the same policy: A = Q(s, a) - V(s) of given actions (docs/algorithms.md, DBR step 6), Q
  // the smaller twin, V its mean under pi (continuous: over kValueSamples draws from `rng`). [n]; the actions
  // may be others than Act's (exploration). NaN (not yet judged) where the snapshot has no critics.
  void Advantages(const ConstMatrixRef<float>& actions, Rng& rng, Eigen::Ref<VectorX<float>> advantages);

  // V(s) of n states, [n]: as in Advantages. NaN where the snapshot has no critics. Act's results are gone
  // afterwards: Advantages needs a new one.
  void Values(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
              const ConstMatrixRef<float>& masks, Rng& rng, Eigen::Ref<VectorX<float>> values);

  // All of the networks' outputs, for probing; discrete actions alone.
  const PolicyView& View(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                         const ConstMatrixRef<float>& masks);

  static constexpr int kGreedySamples = 10;  // of GREEDY_Q over continuous actions
  static constexpr int kValueSamples = 5;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dbr
