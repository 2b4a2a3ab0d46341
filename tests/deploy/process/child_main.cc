// A child for the supervisor's tests: obeys its arguments in order.
//   say TEXT         a line on stderr
//   append FILE      its remaining arguments, as one line, to FILE
//   hold FIFO        keeps the writing end of a named pipe open, and writes one byte to it
//   exit STATUS
//   ignore-sigterm
//   wait FILE NAME   waits for SIGTERM, appends NAME to FILE and exits with 0
//   wait-and-interrupt-parent   answers SIGTERM with a SIGINT to its parent, and stays
//   wait-and-interrupt-parent-once   the same, and exits with 0
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

namespace {

void WaitFor(int signal_number) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, signal_number);
  int taken = 0;
  sigwait(&set, &taken);
}

void Append(const std::string& file, const std::string& line) {
  std::ofstream(file, std::ios::app) << line << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  sigset_t term;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  sigprocmask(SIG_BLOCK, &term, nullptr);
  for (int i = 1; i < argc; ++i) {
    const std::string order = argv[i];
    if (order == "say") {
      std::fprintf(stderr, "%s\n", argv[++i]);
    } else if (order == "append") {
      std::string line;
      for (int k = i + 2; k < argc; ++k) line += std::string(argv[k]) + " ";
      Append(argv[++i], line);
    } else if (order == "hold") {
      const int fd = open(argv[++i], O_WRONLY);
      if (write(fd, "h", 1) != 1) return 3;
    } else if (order == "exit") {
      return std::atoi(argv[++i]);
    } else if (order == "ignore-sigterm") {
      for (;;) pause();
    } else if (order == "wait") {
      WaitFor(SIGTERM);
      Append(argv[i + 1], argv[i + 2]);
      return 0;
    } else if (order == "wait-and-interrupt-parent") {
      WaitFor(SIGTERM);
      kill(getppid(), SIGINT);
      for (;;) pause();
    } else if (order == "wait-and-interrupt-parent-once") {
      WaitFor(SIGTERM);
      kill(getppid(), SIGINT);
      return 0;
    }
  }
  return 0;
}
