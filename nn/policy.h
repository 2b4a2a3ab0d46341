// Acting by a policy's networks, for many environments at once.
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "core/batch.h"
#include "core/rng.h"
#include "nn/policy_networks.h"
#include "nn/policy_view.h"
#include "proto/config.pb.h"

namespace dbr {

// Runs the networks of a policy, which the caller passes to each call, so that it may be another one every
// time. Holds workspaces for one thread; allocates only when a batch is larger than any before. Throughout, n
// columns are n environments: observations [observation x n], masks [mask width x n] (1 where an action is
// legal; without rows over continuous actions), actions [width x n] (an index, or one value for each
// dimension in [-1, 1]).
class PolicyRunner {
 public:
  PolicyRunner();
  ~PolicyRunner();

  // Chooses an action for each column, into `actions`. GREEDY_Q over continuous actions takes the best of
  // kGreedySamples draws (nn/continuous_actor.h). InvalidArgument where `mode` needs networks that the policy
  // lacks, or another action space; Internal where a network gives a value that is not finite.
  absl::Status Act(const PolicyNetworks& policy, ActingMode mode, const ConstMatrixRef<float>& observations,
                   const ConstMatrixRef<float>& masks, Rng& rng, Eigen::Ref<MatrixX<float>> actions);

  // A = Q(s, a) - V(s) [n] of the given actions at the observations of the Act before, by the same policy
  // (docs/algorithms.md, DBR step 6). Q is the smaller twin, V its mean under pi (over continuous actions: of
  // kValueSamples draws from `rng`, nn/continuous_actor.h). The actions may be others than Act's, where the
  // actor explores. NaN (not yet judged) where the policy has no critics.
  void Advantages(const ConstMatrixRef<float>& actions, Rng& rng, Eigen::Ref<VectorX<float>> advantages);

  // V(s) [n], as in Advantages. NaN where the policy has no critics. Advantages needs a new Act afterwards.
  void Values(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
              const ConstMatrixRef<float>& masks, Rng& rng, Eigen::Ref<VectorX<float>> values);

  // All of the networks' outputs, valid until the next call. Requires discrete actions.
  const PolicyView& View(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                         const ConstMatrixRef<float>& masks);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dbr
