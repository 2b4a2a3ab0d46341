// Transitions that tests can recognise.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/columns.h"
#include "core/transition.h"
#include "replay/buffer/buffer_types.h"

namespace dbr {

inline constexpr TransitionLayout kSmallLayout{.observation_width = 4, .action_width = 1, .mask_width = 3};
inline constexpr TransitionLayout kLayoutWithReturns{
    .observation_width = 4, .action_width = 1, .mask_width = 3, .return_width = 1};

// Columns of transitions first, first + 1, ...: every value of transition i follows from i.
class Rows : public ColumnSet<std::vector<float>> {
 public:
  Rows(const TransitionLayout& layout, std::uint64_t first, int count, float advantage = kUnjudged)
      : layout_(layout) {
    for (std::uint64_t i = first; i < first + static_cast<std::uint64_t>(count); ++i) Add(i, advantage);
  }

  // What transition i holds at its first observation, reward and next observation.
  static float Value(std::uint64_t i) { return static_cast<float>(i % 100000); }

  InsertColumns columns() const {
    InsertColumns views;
    views.count = static_cast<int>(rewards.size());
    ForEachColumn([](const auto& from, const float*& to) { to = from.data(); }, *this, views);
    views.advantages = advantages.data();
    views.critic_versions = critic_versions.data();
    return views;
  }

  // Row i as it lies in a store.
  void AppendFlat(int i, std::vector<float>* flat) const {
    flat->resize(flat->size() + static_cast<std::size_t>(layout_.stride()));
    WriteRow(columns().Row(layout_, i), layout_, flat->data() + flat->size() - layout_.stride());
  }

  std::vector<float> advantages;
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
class Drawn : public ColumnSet<std::vector<float>> {
 public:
  Drawn(const TransitionLayout& layout, std::size_t count) : keys(count), layout_(layout) {
    ForEachColumn([count](const ColumnPlace& place, auto& column) { column.resize(count * place.width); },
                  layout.columns(), *this);
  }

  DrawColumns columns() {
    DrawColumns room;
    room.keys = keys.data();
    ForEachColumn([](auto& from, float*& to) { to = from.data(); }, *this, room);
    return room;
  }

  void ExpectWhole(std::size_t count) const {
    for (std::size_t i = 0; i < count; ++i) {
      const Rows expected(layout_, static_cast<std::uint64_t>(rewards[i]), 1);
      ForEachColumn(
          [i](const ColumnPlace& place, const auto& found, const auto& wanted) {
            for (int k = 0; k < place.width; ++k)
              ASSERT_EQ(found[i * place.width + k], wanted[k]) << place.name;
          },
          layout_.columns(), *this, expected);
    }
  }

  std::vector<std::uint64_t> keys;

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
