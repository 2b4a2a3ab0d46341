// The interface of an environment, as a learning agent sees it.
#pragma once

#include <cstdint>

#include "absl/types/span.h"
#include "core/space.h"

namespace dbr {

struct Figure;  // envs/figure.h

// The result of one step. `terminated`: the task ended and there is no future value. `truncated`: the episode
// was cut at the time limit, so the state still has future value.
struct StepResult {
  float reward = 0;
  bool terminated = false;
  bool truncated = false;
  bool broken = false;  // the world failed: truncated, with reward 0 and the last finite observation again
  float score = 0;      // at the end of an episode, where the spec has a score: 1 win, 0.5 draw, 0 loss

  bool done() const { return terminated || truncated; }
};

// One world. Its maker owns it. One thread at a time. The same random seed and the same actions give the same
// episode. Not copyable.
class Env {
 public:
  virtual ~Env() = default;

  virtual const EnvSpec& spec() const = 0;

  // Starts an episode. Writes the first observation [spec().observation_size] and legal-action mask
  // [spec().actions.mask_width()] into the caller's memory.
  virtual void Reset(std::uint64_t seed, absl::Span<float> observation, absl::Span<float> mask) = 0;

  // Takes an action [spec().actions.width()], legal under the last mask (CHECKed), and writes the next
  // observation and mask. After an end the observation is the final one and its mask may be all zeros; Reset
  // comes next.
  virtual StepResult Step(absl::Span<const float> action, absl::Span<float> observation,
                          absl::Span<float> mask) = 0;

  // Describes how the world looks now, for drawing. Requires an earlier Reset. Returns false where the
  // environment has no figure.
  virtual bool GetFigure(Figure*) const { return false; }
};

}  // namespace dbr
