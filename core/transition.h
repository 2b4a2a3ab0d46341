// One step of experience, and how it lies in a flat row of floats.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "absl/types/span.h"
#include "core/space.h"

namespace dbr {

inline constexpr float kUnjudged = std::numeric_limits<float>::quiet_NaN();

// A transition (s, a, r, discount, s') as views into memory of somebody else's.
// Masks hold 1 for each legal action, 0 for the others, and are empty for a continuous space.
struct TransitionView {
  absl::Span<const float> observation;
  absl::Span<const float> action;
  absl::Span<const float> mask;
  float reward = 0;
  float discount = 0;  // 0 after a true terminal, gamma elsewhere (also where an episode is cut)
  absl::Span<const float> next_observation;
  absl::Span<const float> next_mask;
};

// Where the fields of a transition lie in a row of `stride()` floats:
// [observation | action | mask | reward | discount | next_observation | next_mask].
struct TransitionLayout {
  int observation_width = 0;
  int action_width = 0;
  int mask_width = 0;

  static TransitionLayout Of(const EnvSpec& spec) {
    return {spec.observation_size, spec.actions.width(), spec.actions.mask_width()};
  }

  int action_offset() const { return observation_width; }
  int mask_offset() const { return action_offset() + action_width; }
  int reward_offset() const { return mask_offset() + mask_width; }
  int discount_offset() const { return reward_offset() + 1; }
  int next_observation_offset() const { return discount_offset() + 1; }
  int next_mask_offset() const { return next_observation_offset() + observation_width; }
  int stride() const { return next_mask_offset() + mask_width; }

  bool operator==(const TransitionLayout&) const = default;
};

// How an episode went; known with the transition that ended it.
struct EpisodeEnd {
  float episode_return = 0;  // undiscounted sum of rewards
  float score =
      std::numeric_limits<float>::quiet_NaN();  // 1 win, 0.5 draw, 0 loss; NaN: the environment has none
  int length = 0;                               // steps of the agent
};

}  // namespace dbr
