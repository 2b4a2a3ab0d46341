#include "core/standard_streams.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <functional>
#include <string>

namespace dbr {
namespace {

// Runs `body` in a process of its own, whose streams may be spoiled, and gives its exit status.
int InAChild(const std::function<int()>& body) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) _exit(body());
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

constexpr int kWhole = 0, kLost = 1, kReaderGone = 2;

int Print(int bytes) {
  for (int i = 0; i < bytes; ++i) std::fputc('x', stdout);
  bool reader_gone = false;
  if (LostOutput(&reader_gone).empty()) return kWhole;
  return reader_gone ? kReaderGone : kLost;
}

int PrintTo(const char* path, int bytes) {
  return InAChild([=] {
    dup2(open(path, O_WRONLY), STDOUT_FILENO);
    return Print(bytes);
  });
}

TEST(StandardStreamsTest, WhatAFullDiskTookIsLost) {
  EXPECT_EQ(PrintTo("/dev/null", 10), kWhole);
  EXPECT_EQ(PrintTo("/dev/full", 10), kLost) << "at the last flush";
  EXPECT_EQ(PrintTo("/dev/full", 1 << 20), kLost) << "in between";
  EXPECT_EQ(PrintTo("/dev/full", 0), kWhole) << "nothing was printed";
}

TEST(StandardStreamsTest, WhatIsPrintedToAClosedStreamIsLost) {
  EXPECT_EQ(InAChild([] {
              for (int fd = 0; fd < 3; ++fd) close(fd);
              HoldStandardStreams();
              const int next = open("/dev/zero", O_RDWR);
              return next > STDERR_FILENO ? Print(10) : 9;
            }),
            kLost);
}

TEST(StandardStreamsTest, StreamsThatAreOpenAreLeftAlone) {
  EXPECT_EQ(InAChild([] {
              dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO);
              close(STDIN_FILENO);
              HoldStandardStreams();
              return Print(10);
            }),
            kWhole);
}

TEST(StandardStreamsTest, AReaderThatWentAwayIsTold) {
  for (const int bytes : {10, 1 << 20}) {
    EXPECT_EQ(InAChild([bytes] {
                signal(SIGPIPE, SIG_IGN);
                int ends[2];
                if (pipe(ends) != 0) return 9;
                close(ends[0]);
                dup2(ends[1], STDOUT_FILENO);
                return Print(bytes);
              }),
              kReaderGone);
  }
}

}  // namespace
}  // namespace dbr
