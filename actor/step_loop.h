// Acting in many environments and turning what happens into transitions.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "actor/exploration.h"
#include "actor/vector_env.h"
#include "core/rng.h"
#include "core/transition.h"
#include "nn/policy.h"
#include "proto/config.pb.h"

namespace dbr {

// Takes one transition, valid during the call, with its first advantage (kUnjudged where there is none), the
// version of the critic behind it, and how the episode went where this transition ended it.
using TransitionSink =
    std::function<absl::Status(const TransitionView& transition, float advantage,
                               std::uint64_t critic_version, const std::optional<EpisodeEnd>& end)>;

struct StepLoopOptions {
  ActingMode mode = SAMPLE;
  ExplorationOptions exploration;
  double discount = 0.99;  // of every transition that does not end in a true terminal
};

struct StepCounters {
  std::uint64_t transitions = 0;
  std::uint64_t episodes = 0;
  std::uint64_t explored = 0;  // actions replaced by random ones
  std::uint64_t broken = 0;    // episodes cut because their world failed
};

// All environments take one step at a time; ended episodes restart with seeds drawn from `rng`, so that the
// same rng and policies give the same transitions. Rewards go out as the environment gave them. One thread at
// a time.
class StepLoop {
 public:
  StepLoop(std::unique_ptr<VectorEnv> envs, const StepLoopOptions& options, const Rng& rng,
           TransitionSink sink);

  // One action in each environment: one forward pass of the policy and one of each critic. Blocks as the sink
  // does. Errors: PolicyRunner::Act's and the sink's; after an error the loop must not be used again.
  absl::Status Step(const PolicyNetworks& policy);

  const StepCounters& counters() const { return counters_; }
  const VectorEnv& envs() const { return *envs_; }

 private:
  struct Episode {
    double episode_return = 0;
    int length = 0;
  };

  absl::Status Emit(int i, std::uint64_t critic_version);

  std::unique_ptr<VectorEnv> envs_;
  const StepLoopOptions options_;
  Exploration exploration_;
  Rng rng_;
  TransitionSink sink_;
  PolicyRunner runner_;
  MatrixX<float> actions_;     // [action width x envs]
  VectorX<float> advantages_;  // [envs]
  std::vector<Episode> episodes_;
  StepCounters counters_;
};

}  // namespace dbr
