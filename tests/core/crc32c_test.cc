#include "core/crc32c.h"

#include <gtest/gtest.h>

#include <numeric>
#include <string>
#include <vector>

namespace dbr {
namespace {

std::uint32_t Of(const std::string& text) {
  return Crc32c(text.data(), text.size());
}

TEST(Crc32cTest, MatchesTheVectorsOfRfc3720) {
  EXPECT_EQ(Of(std::string(32, '\0')), 0x8a9136aau);
  EXPECT_EQ(Of(std::string(32, '\xff')), 0x62a8ab43u);
  std::string counting(32, '\0');
  std::iota(counting.begin(), counting.end(), '\0');
  EXPECT_EQ(Of(counting), 0x46dd794eu);
  EXPECT_EQ(Of(std::string(counting.rbegin(), counting.rend())), 0x113fdb5cu);
  EXPECT_EQ(Of("123456789"), 0xe3069283u);
  EXPECT_EQ(Of(""), 0u);
}

TEST(Crc32cTest, ExtendingByPartsGivesTheWhole) {
  const std::string text = "any text that is longer than two words of eight bytes";
  for (std::size_t cut = 0; cut <= text.size(); ++cut) {
    const std::uint32_t head = Crc32c(text.data(), cut);
    EXPECT_EQ(ExtendCrc32c(head, text.data() + cut, text.size() - cut), Of(text)) << "cut at " << cut;
  }
}

}  // namespace
}  // namespace dbr
