#include "core/file_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "absl/cleanup/cleanup.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::HasSubstr;

int CountFiles(const TempDir& folder) {
  int count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++count;
  return count;
}

TEST(FileIoTest, ReadsBackWhatWasWritten) {
  const TempDir folder;
  const std::string path = folder / "file";
  std::string contents(200000, 'x');
  contents[7] = '\0';
  ASSERT_TRUE(WriteFileAtomically(path, contents).ok());
  EXPECT_EQ(ReadFile(path).value(), contents);
  ASSERT_TRUE(WriteFileAtomically(path, "").ok());
  EXPECT_EQ(ReadFile(path).value(), "");
  EXPECT_EQ(CountFiles(folder), 1);
}

TEST(FileIoTest, MissingFileOrFolderIsNotFoundAndNamed) {
  const TempDir folder;
  const absl::Status read = ReadFile(folder / "none").status();
  EXPECT_EQ(read.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(read.message()), HasSubstr(folder / "none"));
  const absl::Status written = WriteFileAtomically(folder / "none/file", "x");
  EXPECT_EQ(written.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(written.message()), HasSubstr(folder / "none/file"));
}

TEST(FileIoTest, ReadingAFolderIsAnError) {
  const TempDir folder;
  EXPECT_FALSE(ReadFile(folder.path()).ok());
}

// A limit on the size of a file fails a write half-way, as a full disk does.
TEST(FileIoTest, FailedWriteLeavesTheOldContentsAndNothingBeside) {
  const TempDir folder;
  const std::string path = folder / "file";
  ASSERT_TRUE(WriteFileAtomically(path, "old").ok());
  rlimit old_limit;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &old_limit), 0);
  const auto old_handler = signal(SIGXFSZ, SIG_IGN);
  const absl::Cleanup restore = [&] {
    setrlimit(RLIMIT_FSIZE, &old_limit);
    signal(SIGXFSZ, old_handler);
  };
  rlimit limit = old_limit;
  limit.rlim_cur = 1000;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  const absl::Status status = WriteFileAtomically(path, std::string(5000, 'x'));
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(status.message()), HasSubstr(path));
  EXPECT_EQ(ReadFile(path).value(), "old");
  EXPECT_EQ(CountFiles(folder), 1);
}

TEST(FileIoTest, AReaderSeesTheOldOrTheNewContentsNeverAMixture) {
  const TempDir folder;
  const std::string path = folder / "file";
  const std::string a(100000, 'a'), b(150000, 'b');
  ASSERT_TRUE(WriteFileAtomically(path, a).ok());
  std::atomic<bool> stop = false;
  std::thread writer([&] {
    for (int i = 0; !stop; ++i) EXPECT_TRUE(WriteFileAtomically(path, i % 2 == 0 ? b : a).ok());
  });
  int mixtures = 0;
  for (int i = 0; i < 200; ++i) {
    const auto contents = ReadFile(path);
    if (!contents.ok() || (*contents != a && *contents != b)) ++mixtures;
  }
  stop = true;
  writer.join();
  EXPECT_EQ(mixtures, 0);
}

TEST(FileIoTest, ErrnoStatusMapsWhatAUserCanActOn) {
  EXPECT_EQ(ErrnoStatus(ENOSPC, "cannot write", "f").code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(ErrnoStatus(EACCES, "cannot write", "f").code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(ErrnoStatus(ENOENT, "cannot write", "f").code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ErrnoStatus(EIO, "cannot write", "f").code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(ErrnoStatus(EIO, "cannot write", "f").message()), HasSubstr("cannot write f: "));
}

}  // namespace
}  // namespace dbr
