// Acting over continuous actions; the part of PolicyRunner behind it.
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "core/rng.h"
#include "nn/gaussian_head.h"
#include "nn/policy.h"
#include "nn/tanh_gaussian.h"

namespace dbr {

// Workspaces for one thread. The functions are those of PolicyRunner, for observations that are normalised
// already.
class ContinuousActor {
 public:
  absl::Status Act(const PolicyNetworks& policy, ActingMode mode, const ConstMatrixRef<float>& observations,
                   Rng& rng, Eigen::Ref<MatrixX<float>> actions);
  void Advantages(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                  const ConstMatrixRef<float>& actions, Rng& rng, Eigen::Ref<VectorX<float>> advantages);
  void Values(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations, Rng& rng,
              Eigen::Ref<VectorX<float>> values);

 private:
  // Evaluates the policy at the observations, into head_.
  void Evaluate(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations);
  // The smaller twin at the observations, repeated as Critic's, and `actions`, into values_ [columns].
  void EvaluateSmaller(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations,
                       const ConstMatrixRef<float>& actions);
  // V(s) [n] of the observations that head_ is of.
  void MeanValue(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations, Rng& rng,
                 Eigen::Ref<VectorX<float>> values);
  // Draws `count` actions of each state: draw k of state j is column k * n + j of actions_.
  void Sample(Eigen::Index count, Rng& rng);
  // [1 x columns] of the critic at the observations, repeated to as many columns as `actions` has.
  const MatrixX<float>& Critic(const PolicyNetworks& policy, const char* name,
                               const ConstMatrixRef<float>& observations,
                               const ConstMatrixRef<float>& actions);
  void ChooseGreedy(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations, Rng& rng,
                    Eigen::Ref<MatrixX<float>> actions);

  MlpActivations<float> policy_activations_, critic_activations_;
  GaussianHead<float> head_;
  MatrixX<float> actions_;  // [dimensions x count * n]
  MatrixX<float> inputs_;   // [observation + dimensions x columns]
  VectorX<float> values_;
};

}  // namespace dbr
