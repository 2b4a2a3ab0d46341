// Random actions among the chosen ones, more of them in some environments than in others, and noise on the
// rest.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "core/batch.h"
#include "core/rng.h"
#include "core/space.h"
#include "proto/config.pb.h"

namespace dbr {

struct ExplorationOptions {
  double epsilon = 0;  // share of uniformly random actions
  double epsilon_ladder = 0;
  std::uint64_t epsilon_decay_steps = 0;  // of all processes together; 0: epsilon stays as it is
  double final_epsilon = 0;               // after these
  std::uint64_t first_step = 0;           // what all processes together had done before this one began
  int processes = 1;                      // each is taken to be as fast as this one
  double action_noise = 0;                // standard deviation, in units of a continuous action

  static ExplorationOptions Of(const ActorConfig& config);  // for one process, from the first step on
};

// InvalidArgument where a config asks for exploration that the actions do not allow: noise on discrete ones.
absl::Status CheckExploration(const EnvSpec& env, const ActorConfig& config);

// Environment i of n has its own share e^(1 + ladder * i / (n - 1)) of uniformly random actions: with ladder
// 0 all have e, else the last ones nearly none (the ladder of Ape-X, Horgan et al. 2018). e goes linearly
// from epsilon to final_epsilon. Actions that are not replaced get the noise. One thread at a time.
class Exploration {
 public:
  // `n` environments. The options fit the actions (CheckExploration).
  Exploration(const ActionSpace& actions, const ExplorationOptions& options, int n);

  // One step of each environment: replaces columns of `actions` [width x n] by uniformly random legal ones,
  // each with its environment's share; a continuous action by one uniform in [-1, 1]^size. To the others
  // normal noise is added, clipped to [-1, 1]. masks [mask width x n]. Returns how many it replaced.
  int Apply(const MatrixX<float>& masks, Rng& rng, MatrixX<float>* actions);

  const std::vector<double>& shares() const { return shares_; }  // [n] of the next step

 private:
  void SetShares();
  void AddNoise(int i, Rng& rng, MatrixX<float>* actions) const;

  const ActionSpace space_;
  const ExplorationOptions options_;
  std::uint64_t steps_ = 0;  // of all environments of this process
  std::vector<double> shares_;
};

}  // namespace dbr
