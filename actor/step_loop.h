// Acts in many environments and makes transitions from the results.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "actor/episode_returns.h"
#include "actor/exploration.h"
#include "actor/n_step_transitions.h"
#include "actor/next_actions.h"
#include "actor/transition_sink.h"
#include "actor/vector_env.h"
#include "core/rng.h"
#include "core/transition.h"
#include "nn/policy.h"
#include "proto/config.pb.h"

namespace dbr {

struct StepLoopOptions {
  ActingMode mode = SAMPLE;
  ExplorationOptions exploration = {};
  double discount = 0.99;  // for every transition that does not end in a true terminal
  // With returns, transitions wait until their episode has ended, and go out with R - V(s) as the first
  // advantage. With next actions they wait for the next step. Not both.
  OptionalColumns columns = {};
  double reward_scale = 1;  // the critics' reward scale, for that advantage
  int n_step = 1;           // steps of a transition
};

struct StepCounters {
  std::uint64_t transitions = 0;  // one for each step, also where it is held back
  std::uint64_t episodes = 0;
  std::uint64_t explored = 0;  // actions replaced by random ones
  std::uint64_t broken = 0;    // episodes cut because their world failed
};

// All environments take one step at a time. Ended episodes restart with random seeds drawn from `rng`, so
// that the same rng and policies give the same transitions. Rewards go out in the environment's units. With
// returns, an episode's transitions go out together when it has ended (EpisodeReturns). With next actions a
// transition goes out a step later (NextActions). With n_step > 1 it goes out n_step - 1 steps later, or when
// its episode has ended (NStepTransitions). Owns its environments. One thread at a time.
class StepLoop {
 public:
  StepLoop(std::unique_ptr<VectorEnv> envs, const StepLoopOptions& options, const Rng& rng,
           TransitionSink sink);

  // Takes one action in each environment, with one forward pass of the policy and one of each critic. Blocks
  // as the sink does. Returns the errors of PolicyRunner::Act and of the sink. After an error the loop must
  // not be used again.
  absl::Status Step(const PolicyNetworks& policy);

  // Lets go of the transitions that wait for further steps: they go out with fewer steps, and continue with
  // the state that their environment is in. Those that wait for their returns or next actions stay. Blocks as
  // the sink does and returns the sink's first error. Call it after the last step.
  absl::Status Flush() { return n_step_->Flush(); }

  const StepCounters& counters() const { return counters_; }
  // The number of transitions that are held back: until their episodes end, or until further steps.
  std::uint64_t held_back() const {
    return n_step_->held() + (returns_.has_value() ? returns_->held() : 0) +
           (next_actions_.has_value() ? next_actions_->held() : 0);
  }
  const VectorEnv& envs() const { return *envs_; }

 private:
  struct Episode {
    double episode_return = 0;
    int length = 0;
  };

  // Computes the first advantages of the chosen actions, or with returns V(s) instead.
  void Judge(const PolicyNetworks& policy);
  // Finds the environments whose episode the newest step cut, with their last states.
  void FindCuts();
  // Writes V(s') of these environments into next_values_.
  void JudgeCuts(const PolicyNetworks& policy);
  // Writes what the policy would do at their last states into cut_actions_. Errors of PolicyRunner::Act.
  absl::Status ActAtCuts(const PolicyNetworks& policy);
  absl::Status Emit(int i, std::uint64_t critic_version);

  std::unique_ptr<VectorEnv> envs_;
  const StepLoopOptions options_;
  Exploration exploration_;
  Rng rng_;
  const std::unique_ptr<NStepTransitions> n_step_;  // passes transitions on to the sink
  PolicyRunner runner_;
  MatrixX<float> actions_;                       // [action width x envs]
  VectorX<float> advantages_;                    // [envs]; with returns V(s)
  std::optional<EpisodeReturns> returns_;        // with returns, before n_step_
  std::optional<NextActions> next_actions_;      // with next actions, before n_step_
  std::vector<int> cuts_;                        // environments whose episode the newest step cut
  MatrixX<float> cut_observations_, cut_masks_;  // [observation, mask width x cuts]
  VectorX<float> cut_values_;                    // [cuts]
  MatrixX<float> drawn_at_cuts_;                 // [action width x cuts]
  MatrixX<float> cut_actions_;                   // [action width x envs] of those that were cut
  VectorX<float> next_values_;                   // [envs] V(s') where the episode was cut
  std::vector<Episode> episodes_;
  StepCounters counters_;
};

}  // namespace dbr
