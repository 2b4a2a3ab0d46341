// Replaces some chosen actions by random ones, more in some environments than in others, and adds noise to
// the rest.
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
  double epsilon = 0;  // the share of uniformly random actions
  double epsilon_ladder = 0;
  std::uint64_t epsilon_decay_steps = 0;  // steps of all processes together; 0: epsilon is constant
  double final_epsilon = 0;               // epsilon after these steps
  std::uint64_t first_step = 0;           // the steps of all processes together before this one began
  int processes = 1;        // the number of processes; each is assumed to be as fast as this one
  double action_noise = 0;  // the standard deviation, in units of a continuous action

  static ExplorationOptions Of(const ActorConfig& config);  // for one process, from the first step
};

// Returns InvalidArgument where a config asks for exploration that the actions do not allow: noise on
// discrete ones.
absl::Status CheckExploration(const EnvSpec& env, const ActorConfig& config);

// Environment i of n has the share e^(1 + ladder * i / (n - 1)) of uniformly random actions. With ladder 0
// all environments have e; with a large ladder the last ones have nearly none (the ladder of Ape-X, Horgan et
// al. 2018). e moves linearly from epsilon to final_epsilon. Actions that are not replaced get the noise. One
// thread at a time.
class Exploration {
 public:
  // For `n` environments. Requires options that fit the actions (CheckExploration).
  Exploration(const ActionSpace& actions, const ExplorationOptions& options, int n);

  // Makes one step for each environment. It replaces columns of `actions` [width x n] by uniformly random
  // legal ones, with each environment's share. A continuous action is replaced by one uniform in
  // [-1, 1]^size. The others get normal noise and are clipped to [-1, 1]. masks [mask width x n]. Returns the
  // number of replaced actions.
  int Apply(const MatrixX<float>& masks, Rng& rng, MatrixX<float>* actions);

  const std::vector<double>& shares() const { return shares_; }  // [n] for the next step

 private:
  void SetShares();
  void AddNoise(int i, Rng& rng, MatrixX<float>* actions) const;

  const ActionSpace space_;
  const ExplorationOptions options_;
  std::uint64_t steps_ = 0;  // steps of all environments of this process
  std::vector<double> shares_;
};

}  // namespace dbr
