#include "core/symmetry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace dbr {
namespace {

using testing::HasSubstr;

std::string ErrorOf(const Symmetry& symmetry) {
  return std::string(CheckSymmetry(symmetry, /*observation_size=*/3, /*actions=*/2).message());
}

TEST(CheckSymmetry, AcceptsPermutationsThatUndoThemselves) {
  EXPECT_EQ(ErrorOf({.observation = {2, 1, 0}, .action = {1, 0}}), "");
  EXPECT_EQ(ErrorOf({.observation = {0, 1, 2}, .action = {0, 1}}), "");
}

TEST(CheckSymmetry, NamesWhatIsNone) {
  EXPECT_THAT(ErrorOf({.observation = {1, 0}, .action = {1, 0}}),
              HasSubstr("symmetry.observation: expected 3 places, one for each float, found 2"));
  EXPECT_THAT(ErrorOf({.observation = {2, 1, 0}, .action = {}}),
              HasSubstr("symmetry.action: expected 2 places"));
  EXPECT_THAT(ErrorOf({.observation = {2, 1, 0}, .action = {0, 2}}),
              HasSubstr("symmetry.action: expected places from 0 to 1, found 2"));
  EXPECT_THAT(ErrorOf({.observation = {-1, 1, 0}, .action = {1, 0}}), HasSubstr("found -1"));
  EXPECT_THAT(ErrorOf({.observation = {1, 2, 0}, .action = {1, 0}}),
              HasSubstr("a permutation that undoes itself, found that 0 goes to 1 and 1 to 2"));
  EXPECT_THAT(ErrorOf({.observation = {0, 0, 2}, .action = {1, 0}}),
              HasSubstr("found that 1 goes to 0 and 0 to 0"));
}

TEST(Symmetry, IsEmptyUnlessItSaysWhereThingsGo) {
  EXPECT_TRUE(Symmetry().empty());
  EXPECT_FALSE((Symmetry{.observation = {0}, .action = {}}).empty());
}

}  // namespace
}  // namespace dbr
