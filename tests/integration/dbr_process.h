// Runs our programs as processes of a test.
#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace dbr {

// The longest wait. It is reached only where a test fails.
inline constexpr absl::Duration kPatience = absl::Minutes(5);

// A program of build/bin, or one at an absolute path. The test reads its stdout and stderr. The destructor
// kills it. One thread at a time.
//
// `environment`: "NAME=VALUE" entries that are added to the test's own.
class DbrProcess {
 public:
  DbrProcess(const std::string& program, std::vector<std::string> arguments,
             std::vector<std::string> environment = {});
  ~DbrProcess();
  DbrProcess(const DbrProcess&) = delete;
  DbrProcess& operator=(const DbrProcess&) = delete;

  // Reads until `words` have come. Returns false where the output ended or kPatience has passed.
  bool AwaitOutput(const std::string& words);

  // Calls `condition` again at each piece of output, and at least five times a second, until it holds.
  // Returns false where the process ended or kPatience has passed.
  bool Await(const std::function<bool()>& condition);

  void Signal(int number) const;

  // Reads to the end of the output, which comes when the program and all processes that share its output have
  // ended. Returns the exit status, or minus the number of the signal that ended it.
  int Wait();

  pid_t pid() const { return pid_; }
  const std::string& output() const { return output_; }

 private:
  enum class Read { kMore, kNothing, kEnd };
  Read ReadWithin(absl::Duration timeout);

  pid_t pid_ = 0;
  int output_fd_ = -1;
  std::string output_;
};

// Runs a program to its end. Returns {exit status, output}.
std::pair<int, std::string> RunProgram(const std::string& program, std::vector<std::string> arguments,
                                       std::vector<std::string> environment = {});

// Returns the processes whose command line holds both texts. Reads /proc.
std::vector<pid_t> ProcessesOf(const std::string& program, const std::string& words);

// Waits until each of them has ended. Returns false after `timeout`.
bool AllEndWithin(const std::vector<pid_t>& processes, absl::Duration timeout);

}  // namespace dbr
