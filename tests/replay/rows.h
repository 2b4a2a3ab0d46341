// Transitions that tests can recognise.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/transition.h"
#include "replay/buffer/buffer_types.h"

namespace dbr {

inline constexpr TransitionLayout kSmallLayout{.observation_width = 4, .action_width = 1, .mask_width = 3};
inline constexpr TransitionLayout kLayoutWithReturns{
    .observation_width = 4, .action_width = 1, .mask_width = 3, .return_width = 1};

// Columns of transitions first, first + 1, ...: every value of transition i follows from i.
class Rows {
 public:
  Rows(const TransitionLayout& layout, std::uint64_t first, int count, float advantage = kUnjudged)
      : layout_(layout) {
    for (std::uint64_t i = first; i < first + static_cast<std::uint64_t>(count); ++i) Add(i, advantage);
  }

  // What transition i holds at its first observation, reward and next observation.
  static float Value(std::uint64_t i) { return static_cast<float>(i % 100000); }

  InsertColumns columns() const {
    return {.count = static_cast<int>(rewards.size()),
            .observations = observations.data(),
            .actions = actions.data(),
            .masks = masks.data(),
            .rewards = rewards.data(),
            .discounts = discounts.data(),
            .returns = returns.data(),
            .next_observations = next_observations.data(),
            .next_masks = next_masks.data(),
            .advantages = advantages.data(),
            .critic_versions = critic_versions.data()};
  }

  // Row i as it lies in a store.
  void AppendFlat(int i, std::vector<float>* flat) const {
    const TransitionView row = columns().Row(layout_, i);
    for (const auto& part : {row.observation, row.action, row.mask})
      flat->insert(flat->end(), part.begin(), part.end());
    flat->insert(flat->end(), {row.reward, row.discount});
    if (layout_.return_width > 0) flat->push_back(row.monte_carlo_return);
    for (const auto& part : {row.next_observation, row.next_mask})
      flat->insert(flat->end(), part.begin(), part.end());
  }

  std::vector<float> observations, actions, masks, rewards, discounts, returns, next_observations, next_masks,
      advantages;
  std::vector<std::uint64_t> critic_versions;

 private:
  void Add(std::uint64_t i, float advantage) {
    for (int k = 0; k < layout_.observation_width; ++k) {
      observations.push_back(Value(i) + 0.125f * static_cast<float>(k % 8));
      next_observations.push_back(-Value(i) - 0.125f * static_cast<float>(k % 8));
    }
    for (int k = 0; k < layout_.action_width; ++k) {
      actions.push_back(layout_.mask_width > 0 ? static_cast<float>(i % layout_.mask_width) : 0.25f);
    }
    for (int k = 0; k < layout_.mask_width; ++k) {
      masks.push_back(1);
      next_masks.push_back(static_cast<float>(k % 2));
    }
    rewards.push_back(Value(i));
    discounts.push_back(0.5f);
    if (layout_.return_width > 0) returns.push_back(2 * Value(i) + 1);
    advantages.push_back(advantage);
    critic_versions.push_back(0);
  }

  TransitionLayout layout_;
};

// Memory for a draw, and a check that each drawn row is one transition from end to end.
class Drawn {
 public:
  Drawn(const TransitionLayout& layout, std::size_t count)
      : keys(count),
        observations(count * layout.observation_width),
        actions(count * layout.action_width),
        masks(count * layout.mask_width),
        rewards(count),
        discounts(count),
        returns(count * layout.return_width),
        next_observations(count * layout.observation_width),
        next_masks(count * layout.mask_width),
        layout_(layout) {}

  DrawColumns columns() {
    return {.keys = keys.data(),
            .observations = observations.data(),
            .actions = actions.data(),
            .masks = masks.data(),
            .rewards = rewards.data(),
            .discounts = discounts.data(),
            .returns = returns.data(),
            .next_observations = next_observations.data(),
            .next_masks = next_masks.data()};
  }

  void ExpectWhole(std::size_t count) const {
    for (std::size_t i = 0; i < count; ++i) {
      const Rows expected(layout_, static_cast<std::uint64_t>(rewards[i]), 1);
      for (int k = 0; k < layout_.observation_width; ++k) {
        ASSERT_EQ(observations[i * layout_.observation_width + k], expected.observations[k]);
        ASSERT_EQ(next_observations[i * layout_.observation_width + k], expected.next_observations[k]);
      }
      for (int k = 0; k < layout_.action_width; ++k) {
        ASSERT_EQ(actions[i * layout_.action_width + k], expected.actions[k]);
      }
      for (int k = 0; k < layout_.mask_width; ++k) {
        ASSERT_EQ(masks[i * layout_.mask_width + k], expected.masks[k]);
        ASSERT_EQ(next_masks[i * layout_.mask_width + k], expected.next_masks[k]);
      }
      ASSERT_EQ(discounts[i], 0.5f);
      if (layout_.return_width > 0) {
        ASSERT_EQ(returns[i], expected.returns[0]);
      }
    }
  }

  std::vector<std::uint64_t> keys;
  std::vector<float> observations, actions, masks, rewards, discounts, returns, next_observations, next_masks;

 private:
  TransitionLayout layout_;
};

// A folder of the test's own, removed with all that it holds.
class TestFolder {
 public:
  TestFolder();
  ~TestFolder();
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace dbr
