#include "replay/buffer/slot_set.h"

#include <gtest/gtest.h>

#include <set>
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
  std::set<std::uint32_t> model;
  for (int step = 0; step < 20000; ++step) {
    const std::uint32_t slot = rng.Below(kCapacity);
    if (model.erase(slot) > 0) {
      slots.Remove(slot);
    } else {
      slots.Insert(slot);
      model.insert(slot);
    }
    ASSERT_EQ(slots.size(), model.size());
    ASSERT_EQ(slots.Contains(slot), model.count(slot) > 0);
    if (model.empty()) continue;
    ASSERT_TRUE(model.count(slots.Draw(&rng)) > 0);
  }
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot)
    EXPECT_EQ(slots.Contains(slot), model.count(slot) > 0);
}

TEST(SlotSetTest, DrawsEachMemberAsOften) {
  SlotSet slots(100);
  Rng rng(9);
  for (std::uint32_t slot = 0; slot < 100; ++slot) slots.Insert(slot);
  for (std::uint32_t slot = 0; slot < 90; ++slot) slots.Remove(slot);
  constexpr int kDraws = 100000;
  std::vector<int> counts(100);
  for (int i = 0; i < kDraws; ++i) ++counts[slots.Draw(&rng)];
  double chi_square = 0;  // 9 degrees of freedom; 33.7 has a probability of 1e-4
  for (std::uint32_t slot = 90; slot < 100; ++slot) {
    const double off = counts[slot] - kDraws / 10.0;
    chi_square += off * off / (kDraws / 10.0);
  }
  EXPECT_LT(chi_square, 33.7);
}

}  // namespace
}  // namespace dbr
