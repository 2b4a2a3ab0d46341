// Acting over discrete actions; the part of PolicyRunner behind it.
#pragma once

#include "absl/status/status.h"
#include "core/rng.h"
#include "nn/categorical.h"
#include "nn/policy.h"

namespace dbr {

// Workspaces for one thread. The functions are those of PolicyRunner, for observations that are normalised
// already.
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
  const MatrixX<float>& Run(const PolicyNetworks& policy, const char* name,
                            const ConstMatrixRef<float>& observations);
  void RunCategorical(const PolicyNetworks& policy, const char* name,
                      const ConstMatrixRef<float>& observations, const ConstMatrixRef<float>& masks,
                      MatrixX<float>* probabilities);
  void RunCritics(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations);
  void RunDualBehavior(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                       const ConstMatrixRef<float>& masks);

  MlpActivations<float> activations_;
  Categorical<float> distribution_;
  PolicyView view_;
};

}  // namespace dbr
