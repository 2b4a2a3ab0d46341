#include "deploy/terminal/terminal.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <cstdio>
#include <string>

#include "core/check.h"
#include "deploy/terminal/progress_bar.h"

namespace dbr {
namespace {

using testing::HasSubstr;

// A terminal that the test looks at. Its lines end as they are written, without a carriage return.
class TerminalTest : public testing::Test {
 protected:
  TerminalTest() {
    seen_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    DBR_CHECK(seen_ >= 0 && grantpt(seen_) == 0 && unlockpt(seen_) == 0);
    out_ = std::fopen(ptsname(seen_), "w+");
    DBR_CHECK(out_ != nullptr);
    termios settings;
    DBR_CHECK(tcgetattr(fileno(out_), &settings) == 0);
    settings.c_oflag &= ~static_cast<tcflag_t>(OPOST);
    DBR_CHECK(tcsetattr(fileno(out_), TCSANOW, &settings) == 0);
    if (const char* type = getenv("TERM")) before_ = type;
  }
  ~TerminalTest() override {
    std::fclose(out_);
    close(seen_);
    before_.empty() ? unsetenv("TERM") : setenv("TERM", before_.c_str(), 1);
  }

  std::string Seen() const {
    std::fflush(out_);
    pollfd ready = {seen_, POLLIN, 0};
    std::string text;
    char buffer[4096];
    while (poll(&ready, 1, 0) == 1 && (ready.revents & POLLIN) != 0) {
      const ssize_t n = read(seen_, buffer, sizeof buffer);
      if (n <= 0) break;
      text.append(buffer, static_cast<std::size_t>(n));
    }
    return text;
  }

  int seen_ = -1;
  std::FILE* out_ = nullptr;

 private:
  std::string before_;
};

TEST_F(TerminalTest, ATerminalThatCannotBeWrittenOverIsNone) {
  setenv("TERM", "xterm", 1);
  EXPECT_TRUE(IsTerminal(fileno(out_)));
  for (const char* type : {"dumb", ""}) {
    setenv("TERM", type, 1);
    EXPECT_FALSE(IsTerminal(fileno(out_))) << type;
  }
  unsetenv("TERM");
  EXPECT_FALSE(IsTerminal(fileno(out_)));
  setenv("TERM", "xterm", 1);
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  EXPECT_FALSE(IsTerminal(ends[1]));
  for (const int end : ends) close(end);
}

TEST_F(TerminalTest, ADumbTerminalGetsLinesAndNoEscapeSequences) {
  const absl::Time start = absl::UnixEpoch();
  for (const bool dumb : {true, false}) {
    setenv("TERM", dumb ? "dumb" : "xterm", 1);
    {
      ProgressBar bar(out_, {.label = "hopper", .unit = "steps", .done = 0, .total = 100, .elapsed = {}},
                      start, absl::Seconds(10));
      bar.Update(50, start + absl::Seconds(10));
    }
    const std::string text = Seen();
    EXPECT_THAT(text, HasSubstr("50 of 100 steps"));
    EXPECT_EQ(text.find('\033') == std::string::npos && text.find('\r') == std::string::npos, dumb) << text;
  }
}

}  // namespace
}  // namespace dbr
