#include "core/temporary_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

std::set<std::string> NamesIn(const std::string& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) names.insert(entry.path().filename());
  return names;
}

// A process that makes a temporary for `path`, says so and waits to be killed. Gives its id.
pid_t StartWriter(const std::string& path) {
  int ends[2];
  EXPECT_EQ(pipe(ends), 0);
  const pid_t writer = fork();
  if (writer == 0) {
    const auto file = TemporaryFile::Create(path);
    const bool good = file.ok() && write((*file)->fd(), "half", 4) == 4 && write(ends[1], "x", 1) == 1;
    while (good) pause();
    _exit(1);
  }
  close(ends[1]);
  char said = 0;
  EXPECT_EQ(read(ends[0], &said, 1), 1);
  close(ends[0]);
  return writer;
}

void Kill(pid_t process) {
  kill(process, SIGKILL);
  EXPECT_EQ(waitpid(process, nullptr, 0), process);
}

TEST(TemporaryFileTest, TakesTheOthersPlaceWhenItIsCommitted) {
  const TempDir folder;
  const std::string path = folder / "file";
  ASSERT_TRUE(WriteFileAtomically(path, "old").ok());
  const auto file = TemporaryFile::Create(path);
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_EQ(write((*file)->fd(), "new", 3), 3);
  EXPECT_EQ(ReadFile(path).value(), "old");
  EXPECT_THAT(NamesIn(folder.path()), SizeIs(2));
  ASSERT_TRUE((*file)->Commit().ok());
  EXPECT_EQ(ReadFile(path).value(), "new");
  EXPECT_THAT(NamesIn(folder.path()), ElementsAre("file"));
}

TEST(TemporaryFileTest, IsRemovedWhereItIsNotCommitted) {
  const TempDir folder;
  ASSERT_TRUE(TemporaryFile::Create(folder / "file").ok());
  EXPECT_THAT(NamesIn(folder.path()), IsEmpty());
}

TEST(TemporaryFileTest, WhatAKilledProcessLeftIsRemovedByTheNextWriteInTheFolder) {
  const TempDir folder;
  Kill(StartWriter(folder / "one"));
  Kill(StartWriter(folder / "two"));
  EXPECT_THAT(NamesIn(folder.path()), SizeIs(1)) << "the second removed what the first one left";
  ASSERT_TRUE(WriteFileAtomically(folder / "three", "x").ok());
  EXPECT_THAT(NamesIn(folder.path()), ElementsAre("three"));
}

TEST(TemporaryFileTest, TheFileOfALivingProcessIsLeftAlone) {
  const TempDir folder;
  const pid_t writer = StartWriter(folder / "one");
  const auto own = TemporaryFile::Create(folder / "two");
  ASSERT_TRUE(own.ok()) << own.status();
  ASSERT_TRUE(WriteFileAtomically(folder / "three", "x").ok());
  EXPECT_THAT(NamesIn(folder.path()), SizeIs(3));
  EXPECT_TRUE((*own)->Commit().ok());
  Kill(writer);
}

// A process id may be given away again, and another machine has the same ones.
TEST(TemporaryFileTest, NoProcessIdIsASignOfLife) {
  const TempDir folder;
  std::ofstream(folder / absl::StrCat(".dbr-", getpid(), "-0.partial")) << "of a process with our number";
  ASSERT_TRUE(WriteFileAtomically(folder / "file", "x").ok());
  EXPECT_THAT(NamesIn(folder.path()), ElementsAre("file"));
}

TEST(TemporaryFileTest, FilesOfOtherNamesAndKindsAreLeftAlone) {
  const TempDir folder;
  const std::set<std::string> others = {".dbr-1-0.partial.bak", ".dbr-a.partial", "file.tmp.12",
                                        "dbr-1-0.partial", ".dbr-.partia"};
  for (const std::string& name : others) std::ofstream(folder / name) << "precious";
  std::filesystem::create_directory(folder / ".dbr-7-0.partial");
  std::filesystem::create_symlink(folder / "file.tmp.12", folder / ".dbr-8-0.partial");
  ASSERT_EQ(mkfifo((folder / ".dbr-9-0.partial").c_str(), 0600), 0);
  ASSERT_TRUE(WriteFileAtomically(folder / "written", "x").ok());
  EXPECT_THAT(NamesIn(folder.path()), SizeIs(others.size() + 4));
  EXPECT_EQ(ReadFile(folder / "file.tmp.12").value(), "precious");
}

TEST(TemporaryFileTest, FilesOfOtherUsersAreLeftAlone) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  const TempDir folder;
  const std::string name = ".dbr-7-0.partial";
  std::ofstream(folder / name) << "theirs";
  ASSERT_EQ(chown((folder / name).c_str(), 65534, 65534), 0);
  ASSERT_TRUE(WriteFileAtomically(folder / "file", "x").ok());
  EXPECT_THAT(NamesIn(folder.path()), ElementsAre(name, "file"));
}

TEST(TemporaryFileTest, TheNameMayBeAsLongAsTheFileSystemAllows) {
  const TempDir folder;
  EXPECT_TRUE(WriteFileAtomically(folder / std::string(255, 'x'), "x").ok());
  const std::string longer = folder / std::string(256, 'x');
  const absl::Status status = WriteFileAtomically(longer, "x");
  EXPECT_THAT(std::string(status.message()), HasSubstr(longer));
  EXPECT_THAT(NamesIn(folder.path()), ElementsAre(std::string(255, 'x')));
}

TEST(TemporaryFileTest, AFolderInTheFilesPlaceIsSaid) {
  const TempDir folder;
  std::filesystem::create_directory(folder / "file");
  EXPECT_THAT(std::string(WriteFileAtomically(folder / "file", "x").message()), HasSubstr(folder / "file"));
  EXPECT_THAT(NamesIn(folder.path()), ElementsAre("file"));
}

}  // namespace
}  // namespace dbr
