// Transitions in columns, as views into memory of somebody else's: how batches enter and leave the buffer.
#pragma once

#include <cstddef>
#include <cstdint>

#include "absl/types/span.h"
#include "core/transition.h"

namespace dbr {

// `count` transitions to store. Each column holds its rows one after another; widths are the layout's.
struct InsertColumns {
  int count = 0;
  const float* observations = nullptr;             // [count x observation width]
  const float* actions = nullptr;                  // [count x action width]
  const float* masks = nullptr;                    // [count x mask width]
  const float* rewards = nullptr;                  // [count]
  const float* discounts = nullptr;                // [count]
  const float* returns = nullptr;                  // [count x return width]
  const float* next_observations = nullptr;        // [count x observation width]
  const float* next_masks = nullptr;               // [count x mask width]
  const float* advantages = nullptr;               // [count], NaN: not yet judged; or null: none is judged
  const std::uint64_t* critic_versions = nullptr;  // [count] of the advantages; or null: all 0

  TransitionView Row(const TransitionLayout& layout, int i) const {
    const std::size_t row = static_cast<std::size_t>(i), observation = layout.observation_width,
                      action = layout.action_width, mask = layout.mask_width;
    return {.observation = {observations + row * observation, observation},
            .action = {actions + row * action, action},
            .mask = {masks + row * mask, mask},
            .reward = rewards[row],
            .discount = discounts[row],
            .next_observation = {next_observations + row * observation, observation},
            .next_mask = {next_masks + row * mask, mask},
            .monte_carlo_return = layout.return_width > 0 ? returns[row] : kNoReturn};
  }
  float Advantage(int i) const { return advantages == nullptr ? kUnjudged : advantages[i]; }
  std::uint64_t CriticVersion(int i) const { return critic_versions == nullptr ? 0 : critic_versions[i]; }
};

// Room for one part of a draw; the same shapes, all writable.
struct DrawColumns {
  std::uint64_t* keys = nullptr;  // [count]
  float* observations = nullptr;
  float* actions = nullptr;
  float* masks = nullptr;
  float* rewards = nullptr;
  float* discounts = nullptr;
  float* returns = nullptr;
  float* next_observations = nullptr;
  float* next_masks = nullptr;
};

}  // namespace dbr
