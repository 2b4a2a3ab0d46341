// Acting over continuous actions: PolicyRunner's part for them (nn/policy.h).
#pragma once

#include "absl/status/status.h"
#include "core/batch.h"
#include "core/rng.h"
#include "nn/gaussian_head.h"
#include "nn/mlp.h"
#include "nn/policy_networks.h"
#include "proto/config.pb.h"

namespace dbr {

// How many actions are drawn for each state.
inline constexpr int kGreedySamples = 10;  // of which the mode GREEDY_Q takes the best
inline constexpr int kValueSamples = 5;    // whose mean Q is V

// Holds workspaces for one thread. The functions are those of PolicyRunner, for observations that are
// normalised already.
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
  // V(s) [n] at the observations that Evaluate was last called with.
  void MeanValue(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations, Rng& rng,
                 Eigen::Ref<VectorX<float>> values);
  // Draws `count` actions of each state: draw k of state j is column k * n + j of actions_.
  void Sample(Eigen::Index count, Rng& rng);
  // [1 x columns] of the critic at the observations, repeated to as many columns as `actions` has.
  const MatrixX<float>& Critic(const PolicyNetworks& policy, const char* name,
                               const ConstMatrixRef<float>& observations,
                               const ConstMatrixRef<float>& actions);
  // Internal where the critic gives a value that is not finite.
  absl::Status ChooseGreedy(const PolicyNetworks& policy, const ConstMatrixRef<float>& observations, Rng& rng,
                            Eigen::Ref<MatrixX<float>> actions);

  MlpActivations<float> policy_activations_, critic_activations_;
  GaussianHead<float> head_;
  MatrixX<float> actions_;  // [dimensions x count * n]
  MatrixX<float> inputs_;   // [observation + dimensions x columns]
  VectorX<float> values_;
};

}  // namespace dbr
