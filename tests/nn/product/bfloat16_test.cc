// Tests rounding to bfloat16 against its definition.
#include "nn/product/bfloat16.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace dbr {
namespace {

// The nearest number that has the upper 16 bits of a float alone, a tie to the one whose last bit is 0.
std::uint16_t Nearest(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t below = bits >> 16, rest = bits & 0xffff;
  if (rest > 0x8000 || (rest == 0x8000 && (below & 1) == 1)) return static_cast<std::uint16_t>(below + 1);
  return static_cast<std::uint16_t>(below);
}

TEST(Bfloat16Test, RoundsToTheNearestAndTiesToEven) {
  std::vector<float> values;
  for (std::uint32_t upper = 0; upper < 0x10000; ++upper) {
    for (const std::uint32_t lower : {0x0000u, 0x0001u, 0x7fffu, 0x8000u, 0x8001u, 0xffffu}) {
      values.push_back(std::bit_cast<float>(upper << 16 | lower));
    }
  }
  std::vector<Bfloat16> rounded(values.size());
  RoundToBfloat16(values.data(), static_cast<Eigen::Index>(values.size()), rounded.data());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto bits = std::bit_cast<std::uint16_t>(rounded[i]);
    if (std::isnan(values[i])) {
      ASSERT_TRUE(std::isnan(static_cast<float>(rounded[i]))) << std::bit_cast<std::uint32_t>(values[i]);
    } else {
      ASSERT_EQ(bits, Nearest(values[i])) << values[i];
    }
  }
}

TEST(Bfloat16Test, TooLargeANumberBecomesInfinite) {
  const float values[] = {std::numeric_limits<float>::max(), -std::numeric_limits<float>::max()};
  Bfloat16 rounded[2];
  RoundToBfloat16(values, 2, rounded);
  EXPECT_EQ(static_cast<float>(rounded[0]), std::numeric_limits<float>::infinity());
  EXPECT_EQ(static_cast<float>(rounded[1]), -std::numeric_limits<float>::infinity());
}

TEST(Bfloat16Test, RowsArePaddedForBfloat16Alone) {
  EXPECT_EQ(PaddedRows<Bfloat16>(1), 32);
  EXPECT_EQ(PaddedRows<Bfloat16>(32), 32);
  EXPECT_EQ(PaddedRows<Bfloat16>(33), 64);
  EXPECT_EQ(PaddedRows<float>(33), 33);
  EXPECT_EQ(PaddedRows<double>(1), 1);
}

}  // namespace
}  // namespace dbr
