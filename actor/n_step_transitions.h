// Makes n-step transitions of an actor's single steps, between the step loop and its sink.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "actor/transition_sink.h"
#include "core/n_step.h"
#include "core/transition.h"

namespace dbr {

// Holds back the last n - 1 steps of each environment until what follows is known (NStepAccumulator). A
// transition has the advantage and the critic version of the step that it starts with. The result of an
// episode goes out with the transition that its last step starts. One thread at a time.
class NStepTransitions {
 public:
  // Environments have the numbers 0 to envs - 1. Requires n >= 1.
  NStepTransitions(const TransitionLayout& layout, int envs, int n, TransitionSink sink);

  // Takes the next step of environment `env`. Blocks as the sink does and returns the sink's first error.
  absl::Status Add(int env, const TransitionView& step, const FirstJudgement& judgement,
                   const std::optional<EpisodeEnd>& end);

  // Passes on all steps that are held back, as transitions of fewer steps that continue with the newest state
  // of their environment. Blocks as the sink does and returns the sink's first error; the rest is still held.
  absl::Status Flush();

  std::uint64_t held() const;  // steps

 private:
  const TransitionSink sink_;
  std::vector<NStepAccumulator> steps_;  // [envs]
};

}  // namespace dbr
