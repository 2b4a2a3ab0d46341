// Acting in many environments and turning what happens into transitions.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "actor/episode_returns.h"
#include "actor/exploration.h"
#include "actor/vector_env.h"
#include "core/rng.h"
#include "core/transition.h"
#include "nn/policy.h"
#include "proto/config.pb.h"

namespace dbr {

struct StepLoopOptions {
  ActingMode mode = SAMPLE;
  ExplorationOptions exploration = {};
  double discount = 0.99;  // of every transition that does not end in a true terminal
  // Transitions go out when their episode has ended, with their returns and R - V(s) as first advantage.
  bool with_returns = false;
  double reward_scale = 1;  // of the critics, for that advantage
};

struct StepCounters {
  std::uint64_t transitions = 0;
  std::uint64_t episodes = 0;
  std::uint64_t explored = 0;  // actions replaced by random ones
  std::uint64_t broken = 0;    // episodes cut because their world failed
};

// All environments take one step at a time; ended episodes restart with seeds drawn from `rng`, so that the
// same rng and policies give the same transitions. Rewards go out as the environment gave them. With returns
// an episode's transitions go out together when it has ended (EpisodeReturns). One thread at a time.
class StepLoop {
 public:
  StepLoop(std::unique_ptr<VectorEnv> envs, const StepLoopOptions& options, const Rng& rng,
           TransitionSink sink);

  // One action in each environment: one forward pass of the policy and one of each critic. Blocks as the sink
  // does. Errors: PolicyRunner::Act's and the sink's; after an error the loop must not be used again.
  absl::Status Step(const PolicyNetworks& policy);

  const StepCounters& counters() const { return counters_; }
  // Transitions of episodes that have not ended, held back for their returns.
  std::uint64_t held_back() const { return returns_.has_value() ? returns_->held() : 0; }
  const VectorEnv& envs() const { return *envs_; }

 private:
  struct Episode {
    double episode_return = 0;
    int length = 0;
  };

  // First advantages of the chosen actions, or with returns V(s) in their place.
  void Judge(const PolicyNetworks& policy);
  // V(s') of the environments whose episode was cut, into next_values_.
  void JudgeCuts(const PolicyNetworks& policy);
  absl::Status Emit(int i, std::uint64_t critic_version);

  std::unique_ptr<VectorEnv> envs_;
  const StepLoopOptions options_;
  Exploration exploration_;
  Rng rng_;
  TransitionSink sink_;
  PolicyRunner runner_;
  MatrixX<float> actions_;                       // [action width x envs]
  VectorX<float> advantages_;                    // [envs]; with returns V(s)
  std::optional<EpisodeReturns> returns_;        // with returns
  std::vector<int> cuts_;                        // environments whose episode the newest step cut
  MatrixX<float> cut_observations_, cut_masks_;  // [observation, mask width x cuts]
  VectorX<float> cut_values_;                    // [cuts]
  VectorX<float> next_values_;                   // [envs] V(s') of the cuts
  std::vector<Episode> episodes_;
  StepCounters counters_;
};

}  // namespace dbr
