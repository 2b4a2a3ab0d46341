#include "deploy/launch/folder_claim.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <string>

#include "absl/cleanup/cleanup.h"
#include "core/file_io.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

namespace fs = std::filesystem;

class FolderClaimTest : public testing::Test {
 protected:
  static void Write(const std::string& path, const std::string& text = "text") {
    fs::create_directories(fs::path(path).parent_path());
    ASSERT_TRUE(WriteFileAtomically(path, text).ok());
  }

  // A run that came to its end.
  void MakeFinishedRun() const {
    for (const std::string& path : {run_.config(), run_.summary(), run_.metrics(), run_.replay_store(),
                                    run_.latest_policy(), run_.log("launch"), run_.root + "/results.txt"})
      Write(path);
  }

  // What stands in the run's files, but for the lock.
  std::map<std::string, std::string> Files() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(run_.root)) {
      if (entry.is_regular_file() && entry.path().filename() != "launch.lock")
        files[entry.path()] = *ReadFile(entry.path());
    }
    return files;
  }

  static std::string Refusal(const std::string& root) {
    return std::string(FolderClaim::New(root).status().message());
  }

  static Config Other() {
    Config config;
    config.set_seed(77);
    return config;
  }

  TempDir folder_;
  const RunFolder run_{folder_ / "run"};
};

TEST_F(FolderClaimTest, MakesAFolderAndHoldsItUntilItIsDestroyed) {
  EXPECT_FALSE(IsInUse(run_));
  {
    const auto claim = FolderClaim::New(run_.root);
    ASSERT_TRUE(claim.ok()) << claim.status();
    EXPECT_TRUE((*claim)->is_new());
    EXPECT_TRUE(IsInUse(run_));
    EXPECT_TRUE(absl::IsFailedPrecondition(FolderClaim::OfRun(run_.root).status()));
    EXPECT_THAT(Refusal(run_.root), HasSubstr("in use by another launch"));
  }
  EXPECT_FALSE(IsInUse(run_));
}

// Otherwise a look at a grid could refuse the launch of one of its cells.
TEST_F(FolderClaimTest, AskingWhetherAFolderIsInUseKeepsNobodyOut) {
  ASSERT_TRUE(FolderClaim::New(run_.root).ok());
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(IsInUse(run_));
  EXPECT_TRUE(FolderClaim::OfRun(run_.root).ok());
}

TEST_F(FolderClaimTest, LeavesAFinishedRunAsItIsUntilItBegins) {
  MakeFinishedRun();
  const auto before = Files();
  {
    const auto claim = FolderClaim::OfRun(run_.root);
    ASSERT_TRUE(claim.ok()) << claim.status();
    EXPECT_FALSE((*claim)->is_new());
    ASSERT_TRUE((*claim)->PutConfig(Other()).ok());
    EXPECT_THAT(*ReadFile((*claim)->config_path()), HasSubstr("seed: 77"));
    for (const auto& [path, text] : before) EXPECT_EQ(*ReadFile(path), text) << path;
    (*claim)->Withdraw();
  }
  EXPECT_EQ(Files(), before);
}

TEST_F(FolderClaimTest, TakesTheRunOverWhenItBegins) {
  MakeFinishedRun();
  {
    const auto claim = FolderClaim::OfRun(run_.root);
    ASSERT_TRUE((*claim)->PutConfig(Other()).ok());
    ASSERT_TRUE((*claim)->Begin().ok());
    EXPECT_TRUE(fs::exists((*claim)->config_path())) << "a process that is started again reads it";
    (*claim)->Withdraw();
  }
  const auto after = Files();
  EXPECT_THAT(after.at(run_.config()), HasSubstr("seed: 77"));
  EXPECT_FALSE(after.contains(run_.root + "/results.txt"));
  EXPECT_EQ(after.size(), 6) << "the store, the policy and so on, and no other config";
}

TEST_F(FolderClaimTest, RefusesToGoOnWhereTheStoreWasRemoved) {
  MakeFinishedRun();
  fs::remove(run_.replay_store());
  EXPECT_THAT(std::string(FolderClaim::OfRun(run_.root).status().message()),
              AllOf(HasSubstr("has lost its replay.store"), HasSubstr("dbr evaluate --policy")));
}

// The same command works again, once what was in its way has gone.
TEST_F(FolderClaimTest, AFolderWhoseRunNeverBeganIsFree) {
  {
    const auto claim = FolderClaim::New(run_.root);
    ASSERT_TRUE(claim.ok()) << claim.status();
    ASSERT_TRUE((*claim)->PutConfig(Config()).ok());
    for (const std::string& path : {run_.log("launch"), run_.replay_store(), run_.metrics()}) Write(path);
    (*claim)->Withdraw();
  }
  const auto again = FolderClaim::New(run_.root);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE((*again)->is_new());
}

TEST_F(FolderClaimTest, AFolderWithAnythingElseIsNot) {
  Write(run_.root + "/thesis.tex");
  EXPECT_THAT(Refusal(run_.root), HasSubstr("exists already"));
  EXPECT_FALSE(fs::exists(run_.root + "/launch.lock")) << "nothing is put there";
  EXPECT_EQ(*ReadFile(run_.root + "/thesis.tex"), "text");
}

TEST_F(FolderClaimTest, SaysWhyAFolderCannotBeMade) {
  EXPECT_THAT(Refusal(folder_ / std::string(300, 'x')),
              AllOf(HasSubstr("File name too long"), HasSubstr("Choose another --run-dir")));
  Write(folder_ / "file");
  EXPECT_THAT(Refusal(folder_ / "file"), HasSubstr("expected a folder or nothing, found a file"));
  EXPECT_THAT(Refusal(folder_ / "file/run"), HasSubstr("Not a directory"));
  fs::create_symlink(folder_ / "nothing", folder_ / "link");
  EXPECT_THAT(Refusal(folder_ / "link"), HasSubstr("a link that leads to no folder"));
  fs::create_symlink(folder_ / "circle", folder_ / "circle");
  EXPECT_THAT(Refusal(folder_ / "circle"), HasSubstr("a link that leads to no folder"));
}

TEST_F(FolderClaimTest, SaysWhyAFolderCannotBeRead) {
  const std::string locked = folder_ / "locked";
  fs::create_directory(locked);
  fs::permissions(locked, fs::perms::none);
  const absl::Cleanup unlock = [&locked] { fs::permissions(locked, fs::perms::owner_all); };
  if (access(locked.c_str(), R_OK) == 0) GTEST_SKIP() << "root may read everything";
  EXPECT_THAT(Refusal(locked + "/run"), HasSubstr("Permission denied"));
}

}  // namespace
}  // namespace dbr
