// Tests checkpoints: the newest complete one loads, and damaged ones are named.
#include "learner/runtime/checkpoints.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::HasSubstr;

class CheckpointsTest : public testing::Test {
 protected:
  static TensorFile State(float value) { return {{{"weights", {value, 2, 3}}}, {{"note", "test"}}}; }
  std::filesystem::path PathOf(std::uint64_t updates) const {
    return std::filesystem::path(folder_.path()) /
           absl::StrCat(absl::Dec(updates, absl::kZeroPad12), ".safetensors");
  }
  void Truncate(std::uint64_t updates) {
    std::filesystem::resize_file(PathOf(updates), std::filesystem::file_size(PathOf(updates)) - 3);
  }

  TempDir folder_;
  Checkpoints checkpoints_{folder_.path(), 2};
};

TEST_F(CheckpointsTest, TheNewestLoads) {
  ASSERT_TRUE(checkpoints_.Save(9, State(9)).ok());
  ASSERT_TRUE(checkpoints_.Save(10, State(10)).ok());
  const auto loaded = checkpoints_.LoadNewest();
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_EQ(loaded->file.tensors.at("weights")[0], 10);
  EXPECT_THAT(loaded->refused, testing::IsEmpty());
}

TEST_F(CheckpointsTest, OlderOnesAreRemoved) {
  for (const int i : {1, 2, 3}) ASSERT_TRUE(checkpoints_.Save(static_cast<std::uint64_t>(i), State(1)).ok());
  EXPECT_FALSE(std::filesystem::exists(PathOf(1)));
  EXPECT_TRUE(std::filesystem::exists(PathOf(2)));
  EXPECT_TRUE(std::filesystem::exists(PathOf(3)));
}

TEST_F(CheckpointsTest, ADamagedNewestIsRefusedByNameAndTheOneBeforeLoads) {
  ASSERT_TRUE(checkpoints_.Save(1, State(1)).ok());
  ASSERT_TRUE(checkpoints_.Save(2, State(2)).ok());
  Truncate(2);
  const auto loaded = checkpoints_.LoadNewest();
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_EQ(loaded->file.tensors.at("weights")[0], 1);
  ASSERT_EQ(loaded->refused.size(), 1u);
  EXPECT_THAT(loaded->refused[0], HasSubstr(PathOf(2).string()));
}

TEST_F(CheckpointsTest, WhereAllAreDamagedEachIsNamed) {
  ASSERT_TRUE(checkpoints_.Save(1, State(1)).ok());
  ASSERT_TRUE(checkpoints_.Save(2, State(2)).ok());
  Truncate(1);
  Truncate(2);
  const absl::Status status = checkpoints_.LoadNewest().status();
  EXPECT_TRUE(absl::IsDataLoss(status));
  EXPECT_THAT(std::string(status.message()),
              testing::AllOf(HasSubstr(PathOf(1).string()), HasSubstr(PathOf(2).string())));
}

TEST_F(CheckpointsTest, AnEmptyFolderIsNotFound) {
  EXPECT_TRUE(absl::IsNotFound(checkpoints_.LoadNewest().status()));
}

}  // namespace
}  // namespace dbr
