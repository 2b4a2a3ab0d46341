#include "core/rng.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace dbr {
namespace {

TEST(RngTest, FollowsThePublishedGenerator) {
  Rng rng(0);
  rng.set_state({1, 2, 3, 4});
  EXPECT_EQ(rng(), 41943041u);
  EXPECT_EQ(rng(), 58720359u);
  EXPECT_EQ(rng(), 3588806011781223u);
  EXPECT_EQ(rng(), 3591011842654386u);
}

TEST(RngTest, SeedsBySplitmix64) {
  EXPECT_EQ(Rng(0).state()[0], 0xe220a8397b1dcdafu);
  Rng rng(1);
  EXPECT_EQ(rng(), 0xcfc5d07f6f03c29bu);
  EXPECT_EQ(rng(), 0xbf424132963fe08du);
  EXPECT_EQ(rng(), 0x19a37d5757aaf520u);
}

TEST(RngTest, ContinuesFromASavedState) {
  Rng rng(7);
  for (int i = 0; i < 10; ++i) rng();
  Rng other(8);
  other.set_state(rng.state());
  for (int i = 0; i < 100; ++i) EXPECT_EQ(other(), rng());
}

TEST(RngTest, BelowIsUniform) {
  Rng rng(2);
  constexpr int kDraws = 70000, kChoices = 7;
  std::array<int, kChoices> counts{};
  for (int i = 0; i < kDraws; ++i) ++counts.at(rng.Below(kChoices));
  double chi_squared = 0;
  for (const int count : counts) {
    const double expected = double{kDraws} / kChoices;
    chi_squared += (count - expected) * (count - expected) / expected;
  }
  EXPECT_LT(chi_squared, 22.5);  // 6 degrees of freedom: exceeded once in 1,000 seeds
  for (int i = 0; i < 100; ++i) EXPECT_EQ(rng.Below(1), 0u);
}

TEST(RngTest, UniformFillsTheUnitInterval) {
  Rng rng(3);
  double sum = 0, least = 1, most = 0;
  for (int i = 0; i < 100000; ++i) {
    const double u = rng.Uniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    sum += u;
    least = std::min(least, u);
    most = std::max(most, u);
  }
  EXPECT_NEAR(sum / 100000, 0.5, 0.004);
  EXPECT_LT(least, 1e-3);
  EXPECT_GT(most, 1 - 1e-3);
}

TEST(RngTest, NormalHasTheMomentsOfAStandardNormal) {
  Rng rng(4);
  constexpr int kDraws = 200000;
  std::array<double, 5> moments{};
  for (int i = 0; i < kDraws; ++i) {
    const double z = rng.Normal();
    ASSERT_TRUE(std::isfinite(z));
    for (int power = 1; power <= 4; ++power) moments[power] += std::pow(z, power) / kDraws;
  }
  EXPECT_NEAR(moments[1], 0, 0.01);
  EXPECT_NEAR(moments[2], 1, 0.02);
  EXPECT_NEAR(moments[3], 0, 0.04);
  EXPECT_NEAR(moments[4], 3, 0.12);
}

TEST(RngTest, ForksDifferFromTheirParentAndFromEachOther) {
  Rng rng(5);
  std::set<std::uint64_t> firsts{rng()};
  for (std::uint64_t stream = 0; stream < 1000; ++stream) firsts.insert(rng.Fork(stream)());
  EXPECT_EQ(firsts.size(), 1001u);
}

}  // namespace
}  // namespace dbr
