#include "deploy/terminal/output.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "core/file_io.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// A pipe that is small, so that it is soon full.
class Pipe {
 public:
  Pipe() {
    EXPECT_EQ(pipe2(ends_, O_CLOEXEC), 0);
    EXPECT_GT(fcntl(ends_[1], F_SETPIPE_SZ, 4096), 0);
  }
  ~Pipe() {
    CloseReader();
    close(ends_[1]);
  }
  int writer() const { return ends_[1]; }
  void CloseReader() {
    if (ends_[0] >= 0) close(ends_[0]);
    ends_[0] = -1;
  }
  // Reads until `words` have come.
  std::string ReadUntil(const std::string& words) const {
    std::string text;
    while (text.find(words) == std::string::npos) {
      char bytes[4096];
      const ssize_t n = read(ends_[0], bytes, sizeof bytes);
      if (n <= 0) break;
      text.append(bytes, static_cast<std::size_t>(n));
    }
    return text;
  }

 private:
  int ends_[2];
};

TEST(OutputTest, WritesAllInOrderAndIsDoneWhenItIsDestroyed) {
  const TempDir folder;
  const int file = open((folder / "out").c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  std::string expected;
  {
    Output out(file);
    for (int i = 0; i < 1000; ++i) {
      out.Write(std::to_string(i) + "\n");
      expected += std::to_string(i) + "\n";
    }
  }
  close(file);
  EXPECT_EQ(*ReadFile(folder / "out"), expected);
}

// The test itself reads only after it has written more than the pipe and the output hold.
TEST(OutputTest, AReaderThatStallsHoldsNobodyUpAndHearsOfWhatItMissed) {
  const Pipe pipe;
  Output out(pipe.writer());
  const std::string line(1023, 'x');
  EXPECT_FALSE(out.behind());
  for (std::size_t bytes = 0; bytes < 2 * Output::kMostBytes; bytes += 1024) out.Write(line + "\n");
  EXPECT_TRUE(out.behind());
  EXPECT_THAT(pipe.ReadUntil("x\n"), StartsWith(line));
  std::string rest;
  while (out.behind()) rest = pipe.ReadUntil("\n");
  out.Write("the last line\n");
  EXPECT_THAT(pipe.ReadUntil("the last line\n"), HasSubstr("messages are left out: nobody read them"));
}

TEST(OutputTest, EndsThoughItsReaderNeverReads) {
  const Pipe pipe;
  Output out(pipe.writer());
  out.Write(std::string(100'000, 'x'));
}

// A terminal that is ready for a byte need not take a whole text, and a write of it would block.
TEST(OutputTest, EndsThoughItsTerminalIsFrozen) {
  const int screen = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_EQ(grantpt(screen), 0);
  ASSERT_EQ(unlockpt(screen), 0);
  const int terminal = open(ptsname(screen), O_RDWR | O_NOCTTY | O_CLOEXEC);
  {
    Output out(terminal);
    for (int i = 0; i < 50; ++i) out.Write(std::string(601, 'x'));
    EXPECT_TRUE(out.behind());
  }
  close(terminal);
  close(screen);
}

TEST(OutputTest, DropsWhatNobodyCanRead) {
  signal(SIGPIPE, SIG_IGN);
  Pipe pipe;
  pipe.CloseReader();
  const int full = open("/dev/full", O_WRONLY | O_CLOEXEC);
  for (const int fd : {pipe.writer(), full}) {
    Output out(fd);
    for (int i = 0; i < 100; ++i) out.Write(std::string(10'000, 'x'));
  }
  close(full);
}

}  // namespace
}  // namespace dbr
