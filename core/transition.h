// One step of experience, and how it lies in a flat row of floats.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "absl/types/span.h"
#include "core/space.h"

namespace dbr {

inline constexpr float kUnjudged = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kNoReturn = std::numeric_limits<float>::quiet_NaN();

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
  // R: the discounted sum of the rewards of the episode from here on, in the environment's units
  // (core/returns.h). Counts where the layout has a return, and must be finite there.
  float monte_carlo_return = kNoReturn;
};

// Where the fields of a transition lie in a row of `stride()` floats:
// [observation | action | mask | reward | discount | return | next_observation | next_mask].
struct TransitionLayout {
  int observation_width = 0;
  int action_width = 0;
  int mask_width = 0;
  int return_width = 0;  // 1 where transitions carry their Monte-Carlo return, else 0

  // `with_returns`: as NeedsReturns (proto/config/config_file.h) says of the run's config.
  static TransitionLayout Of(const EnvSpec& spec, bool with_returns = false) {
    return {spec.observation_size, spec.actions.width(), spec.actions.mask_width(), with_returns ? 1 : 0};
  }

  int action_offset() const { return observation_width; }
  int mask_offset() const { return action_offset() + action_width; }
  int reward_offset() const { return mask_offset() + mask_width; }
  int discount_offset() const { return reward_offset() + 1; }
  int return_offset() const { return discount_offset() + 1; }
  int next_observation_offset() const { return return_offset() + return_width; }
  int next_mask_offset() const { return next_observation_offset() + observation_width; }
  int stride() const { return next_mask_offset() + mask_width; }

  bool operator==(const TransitionLayout&) const = default;
};

// Writes `transition` to `row` [layout.stride()].
inline void WriteRow(const TransitionView& transition, const TransitionLayout& layout, float* row) {
  const auto copy = [](absl::Span<const float> values, float* to) {
    std::copy(values.begin(), values.end(), to);
  };
  copy(transition.observation, row);
  copy(transition.action, row + layout.action_offset());
  copy(transition.mask, row + layout.mask_offset());
  row[layout.reward_offset()] = transition.reward;
  row[layout.discount_offset()] = transition.discount;
  if (layout.return_width > 0) row[layout.return_offset()] = transition.monte_carlo_return;
  copy(transition.next_observation, row + layout.next_observation_offset());
  copy(transition.next_mask, row + layout.next_mask_offset());
}

// The transition that lies in `row` [layout.stride()]; views into it.
inline TransitionView ViewRow(const float* row, const TransitionLayout& layout) {
  const std::size_t observation = layout.observation_width, mask = layout.mask_width;
  return {.observation = {row, observation},
          .action = {row + layout.action_offset(), static_cast<std::size_t>(layout.action_width)},
          .mask = {row + layout.mask_offset(), mask},
          .reward = row[layout.reward_offset()],
          .discount = row[layout.discount_offset()],
          .next_observation = {row + layout.next_observation_offset(), observation},
          .next_mask = {row + layout.next_mask_offset(), mask},
          .monte_carlo_return = layout.return_width > 0 ? row[layout.return_offset()] : kNoReturn};
}

// How an episode went; known with the transition that ended it.
struct EpisodeEnd {
  float episode_return = 0;  // undiscounted sum of rewards
  float score =
      std::numeric_limits<float>::quiet_NaN();  // 1 win, 0.5 draw, 0 loss; NaN: the environment has none
  int length = 0;                               // steps of the agent
};

}  // namespace dbr
