// Files that come with dbr are found from the source tree, from an installation, and never before the user's
// own.
#include "deploy/cli/shipped_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kName[] = "deploy/configs/some.textproto";

class ShippedFileTest : public testing::Test {
 protected:
  ShippedFileTest() {
    std::filesystem::create_directories(folder_ / "elsewhere");
    std::filesystem::current_path(folder_ / "elsewhere");
  }
  ~ShippedFileTest() override { std::filesystem::current_path(before_); }

  std::string Make(const std::string& name) const {
    const std::filesystem::path path = folder_ / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << "seed: 1\n";
    return path;
  }

  const std::filesystem::path before_ = std::filesystem::current_path();
  const TempDir folder_;
};

TEST_F(ShippedFileTest, ComesFromTheSourceTreeAroundTheBuildFolder) {
  const std::string path = Make("source/deploy/configs/some.textproto");
  const auto found = FindShippedFile(kName, folder_ / "source/build/bin");
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(*found, path);
}

TEST_F(ShippedFileTest, ComesFromThePrefixThatDbrIsInstalledIn) {
  const std::string path = Make("prefix/share/dbr/configs/some.textproto");
  const auto found = FindShippedFile(kName, folder_ / "prefix/bin");
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(*found, path);
}

TEST_F(ShippedFileTest, ComesAfterTheUsersOwnOfThatName) {
  Make("prefix/share/dbr/configs/some.textproto");
  Make(std::string("elsewhere/") + kName);
  const auto found = FindShippedFile(kName, folder_ / "prefix/bin");
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(*found, kName);
}

TEST_F(ShippedFileTest, IsNotWhatAnotherNameMeans) {
  Make("prefix/share/dbr/configs/some.textproto");
  for (const std::string name : {"configs/some.textproto", "/deploy/some.textproto", ""}) {
    const auto found = FindShippedFile(name, folder_ / "prefix/bin");
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_EQ(*found, name);
  }
}

TEST_F(ShippedFileTest, SaysWhereItLookedWhenThereIsNone) {
  const absl::Status missing = FindShippedFile(kName, folder_ / "prefix/bin").status();
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.message()),
              AllOf(HasSubstr(kName), HasSubstr(folder_ / "elsewhere"), HasSubstr(folder_ / "prefix/bin"),
                    HasSubstr("share/dbr/configs/some.textproto")));
}

TEST_F(ShippedFileTest, IsFoundForTheProgramThatRuns) {
  EXPECT_TRUE(FindShippedFile("deploy/configs/connect4.textproto").ok());
}

}  // namespace
}  // namespace dbr
