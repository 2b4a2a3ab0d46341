#include "replay/buffer/slot_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <vector>

#include "core/rng.h"

namespace dbr {
namespace {

constexpr std::uint32_t kCapacity = 64;

TEST(SlotSetTest, BeginsEmpty) {
  const SlotSet slots(kCapacity);
  EXPECT_EQ(slots.size(), 0u);
  EXPECT_FALSE(slots.Contains(0));
}

TEST(SlotSetTest, KeepsTheSetThatAModelKeeps) {
  SlotSet slots(kCapacity);
  Rng rng(7);
  std::map<std::uint32_t, bool> model;  // slot -> whether it is the seed buffer's
  for (int step = 0; step < 20000; ++step) {
    const std::uint32_t slot = rng.Below(kCapacity);
    if (model.erase(slot) > 0) {
      slots.Remove(slot);
    } else {
      const bool of_seed_buffer = rng.Below(step < 10000 ? 2 : 5) == 0;
      slots.Insert(slot, of_seed_buffer);
      model[slot] = of_seed_buffer;
    }
    ASSERT_EQ(slots.size(), model.size());
    ASSERT_EQ(slots.Contains(slot), model.count(slot) > 0);
    const auto seed_buffer = static_cast<std::uint32_t>(
        std::count_if(model.begin(), model.end(), [](const auto& member) { return member.second; }));
    ASSERT_EQ(slots.seed_buffer(), seed_buffer);
    ASSERT_EQ(slots.others(), model.size() - seed_buffer);
    ASSERT_TRUE(model.empty() || model.count(slots.Draw(&rng)) == 1);
    ASSERT_TRUE(seed_buffer == 0 || model.at(slots.DrawSeedBuffer(&rng)));
    ASSERT_TRUE(slots.others() == 0 || !model.at(slots.DrawOther(&rng)));
  }
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot)
    EXPECT_EQ(slots.Contains(slot), model.count(slot) > 0);
}

// chi-square of counts [n] that should be equal.
double ChiSquare(const std::vector<int>& counts) {
  const double expected =
      std::accumulate(counts.begin(), counts.end(), 0) / static_cast<double>(counts.size());
  double sum = 0;
  for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

// Ten members, five of them the seed buffer's, after as many comings and goings that each has moved.
TEST(SlotSetTest, DrawsEachMemberAsOften) {
  SlotSet slots(100);
  Rng rng(9);
  for (std::uint32_t slot = 0; slot < 100; ++slot) slots.Insert(slot, slot % 2 == 0);
  for (std::uint32_t slot = 0; slot < 90; ++slot) slots.Remove(slot);
  constexpr int kDraws = 100000;
  std::vector<int> all(10), seed_buffer(5), others(5);
  for (int i = 0; i < kDraws; ++i) {
    ++all[slots.Draw(&rng) - 90];
    ++seed_buffer[(slots.DrawSeedBuffer(&rng) - 90) / 2];
    ++others[(slots.DrawOther(&rng) - 90) / 2];
  }
  EXPECT_LT(ChiSquare(all), 33.7);          // 9 degrees of freedom: more has a probability of 1e-4
  EXPECT_LT(ChiSquare(seed_buffer), 23.5);  // 4
  EXPECT_LT(ChiSquare(others), 23.5);
}

}  // namespace
}  // namespace dbr
