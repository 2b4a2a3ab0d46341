// Adds to each transition what was done at its next state, between the step loop and its sink.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "core/n_step.h"
#include "core/transition.h"

namespace dbr {

// Takes a transition of environment `env` whose next action is known. It is valid during the call.
using NextActionSink =
    std::function<absl::Status(int env, const TransitionView& transition, const FirstJudgement& judgement,
                               const std::optional<EpisodeEnd>& end)>;

// Holds the newest transition of each environment back until the action after it is known: the action of the
// environment's next transition. After a true terminal it is zeros. Where an episode is cut, the caller gives
// what the policy would have done. Rebrac's target reads it (Tarasov et al. 2023). One thread at a time.
class NextActions {
 public:
  // `layout` must have next actions. Environments have the numbers 0 to envs - 1.
  NextActions(const TransitionLayout& layout, int envs, NextActionSink sink);

  // Takes the next transition of environment `env`, and passes on what it completes. Where `end` cuts the
  // episode (discount above 0), `cut_action` [action width] is what would follow. Blocks as the sink does and
  // returns the sink's first error.
  absl::Status Add(int env, const TransitionView& transition, const FirstJudgement& judgement,
                   const std::optional<EpisodeEnd>& end, absl::Span<const float> cut_action);

  std::uint64_t held() const { return held_; }  // transitions

 private:
  struct Waiting {
    std::vector<float> row;  // [stride]
    FirstJudgement judgement;
    bool holds = false;
  };

  absl::Status PassOn(int env, TransitionView transition, const FirstJudgement& judgement,
                      const std::optional<EpisodeEnd>& end, absl::Span<const float> next_action);

  const TransitionLayout layout_;
  const NextActionSink sink_;
  const std::vector<float> nothing_;  // [action width] zeros
  std::vector<Waiting> waiting_;      // [envs]
  std::uint64_t held_ = 0;
};

}  // namespace dbr
