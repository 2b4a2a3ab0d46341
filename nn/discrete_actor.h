// Acting over discrete actions: PolicyRunner's part for them (nn/policy.h).
#pragma once

#include "absl/status/status.h"
#include "core/batch.h"
#include "core/rng.h"
#include "nn/categorical.h"
#include "nn/mlp.h"
#include "nn/policy_networks.h"
#include "nn/policy_view.h"
#include "proto/config.pb.h"

namespace dbr {

// Holds workspaces for one thread. The functions are those of PolicyRunner, for observations that are
// normalised already.
class DiscreteActor {
 public:
  absl::Status Act(const PolicyNetworks& policy, ActingMode mode, const ConstMatrixRef<float>& observations,
                   const ConstMatrixRef<float>& masks, Rng& rng, Eigen::Ref<MatrixX<float>> actions);
  void Advantages(const ConstMatrixRef<float>& actions, Eigen::Ref<VectorX<float>> advantages) const;
  void Values(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
              const ConstMatrixRef<float>& masks, Eigen::Ref<VectorX<float>> values);
  const PolicyView& View(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                         const ConstMatrixRef<float>& masks);

 private:
  // The probabilities [actions x n] of one network over the legal actions.
  void RunCategorical(const PolicyNetworks& policy, const char* name,
                      const ConstMatrixRef<float>& observations, const ConstMatrixRef<float>& masks,
                      MatrixX<float>* probabilities);
  // The smaller twin into view_.q, and both behaviours of DBR into view_; empty where the policy lacks them.
  void RunCritics(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations);
  void RunDualBehavior(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                       const ConstMatrixRef<float>& masks);

  MlpActivations<float> activations_, critic_activations_;
  Categorical<float> distribution_;
  PolicyView view_;
};

}  // namespace dbr
