// Tests that the build makes code anew when a schema changes that its schema imports.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/file_io.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

// replay.proto imports transition.proto.
TEST(GeneratedCodeTest, IsMadeAnewWhenAnImportedSchemaChanges) {
  const std::string build = DBR_BINARY_DIR;
  const absl::StatusOr<std::string> rules = ReadFile(build + "/build.ninja");
  if (!rules.ok()) GTEST_SKIP() << "the build is not Ninja's";
  const auto rule = rules->find("\nbuild proto/replay.pb.cc ");
  ASSERT_NE(rule, std::string::npos);
  EXPECT_THAT(rules->substr(rule, rules->find("\n\n", rule + 1) - rule), HasSubstr("\n  depfile = "));
  EXPECT_THAT(ReadFile(build + "/proto/replay.pb.d").value_or(""), HasSubstr("/proto/transition.proto"));
}

}  // namespace
}  // namespace dbr
