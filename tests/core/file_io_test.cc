#include "core/file_io.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "absl/cleanup/cleanup.h"
#include "core/shutdown.h"
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

TEST(FileIoTest, WhatIsNoFileIsRefusedAtOnceAndNamed) {
  const TempDir folder;
  const std::string pipe = folder / "pipe";  // that nobody ever writes into
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const std::pair<std::string, std::string> others[] = {
      {folder.path(), "a folder"}, {pipe, "a pipe"}, {"/dev/zero", "a device"}};
  for (const auto& [path, kind] : others) {
    const absl::Status status = ReadFile(path).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), HasSubstr(path + ": expected a file, found " + kind));
    if (path == pipe) continue;  // a text may come through one
    EXPECT_EQ(ReadTextFile(path).status(), status);
  }
}

TEST(FileIoTest, ATextComesFromAPipeHoweverLateItsWriterIs) {
  const TempDir folder;
  const std::string path = folder / "pipe", text(300000, 'x');
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  std::string read;
  std::thread reader([&] { read = ReadTextFile(path).value(); });
  const int fd = open(path.c_str(), O_WRONLY);  // waits for the reader
  for (std::size_t at = 0; at < text.size(); at += 100000)
    EXPECT_EQ(write(fd, text.data() + at, 100000), 100000);
  close(fd);
  reader.join();
  EXPECT_EQ(read, text);
}

TEST(FileIoTest, AnEndlessPipeIsRefusedAndNotKept) {
  const TempDir folder;
  const std::string path = folder / "pipe";
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  const auto old_handler = signal(SIGPIPE, SIG_IGN);
  const absl::Cleanup restore = [&] { signal(SIGPIPE, old_handler); };
  std::thread writer([&] {
    const int fd = open(path.c_str(), O_WRONLY);
    const std::string piece(1 << 16, 'x');
    while (write(fd, piece.data(), piece.size()) > 0) {
    }
    close(fd);
  });
  const absl::Status status = ReadTextFile(path).status();
  writer.join();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("at most 16 MiB"));
}

TEST(FileIoTest, AHugeFileIsRefusedAsText) {
  const TempDir folder;
  const std::string path = folder / "file";
  ASSERT_TRUE(WriteFileAtomically(path, "x").ok());
  std::filesystem::resize_file(path, std::uintmax_t{1} << 40);  // a hole
  EXPECT_THAT(std::string(ReadTextFile(path).status().message()), HasSubstr("at most 16 MiB"));
}

TEST(FileIoTest, ASignalEndsTheWaitForAPipe) {
  const TempDir folder;
  const std::string path = folder / "pipe";
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  sigset_t old_mask, term;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  pthread_sigmask(SIG_SETMASK, nullptr, &old_mask);
  const auto old_handler = signal(SIGPIPE, SIG_DFL);
  BlockShutdownSignals();
  kill(getpid(), SIGTERM);
  EXPECT_EQ(ReadTextFile(path).status().code(), absl::StatusCode::kCancelled);
  int taken = 0;
  sigwait(&term, &taken);  // it was left for whoever handles it
  EXPECT_EQ(taken, SIGTERM);
  signal(SIGPIPE, old_handler);
  pthread_sigmask(SIG_SETMASK, &old_mask, nullptr);
}

TEST(FileIoTest, AByteOrderMarkIsNoPartOfAText) {
  const TempDir folder;
  const std::string path = folder / "file";
  ASSERT_TRUE(WriteFileAtomically(path,
                                  "\xEF\xBB\xBF"
                                  "env { }")
                  .ok());
  EXPECT_EQ(ReadTextFile(path).value(), "env { }");
  ASSERT_TRUE(WriteFileAtomically(path,
                                  "\xFF\xFE"
                                  "e")
                  .ok());
  EXPECT_THAT(std::string(ReadTextFile(path).status().message()),
              HasSubstr("found UTF-16; save it as UTF-8"));
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
