// Our programs as processes of a test.
#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace dbr {

// Reached only where something is wrong.
inline constexpr absl::Duration kPatience = absl::Minutes(5);

// A program of build/bin whose stdout and stderr the test reads. Killed when the object goes. One thread.
class DbrProcess {
 public:
  DbrProcess(const std::string& program, std::vector<std::string> arguments);
  ~DbrProcess();
  DbrProcess(const DbrProcess&) = delete;
  DbrProcess& operator=(const DbrProcess&) = delete;

  // Reads until `words` have come; false where the output ended or patience did.
  bool AwaitOutput(const std::string& words);

  // Asks `condition` again at each piece of output, and at least five times a second, until it holds; false
  // where the process ended or patience did.
  bool Await(const std::function<bool()>& condition);

  void Signal(int number) const;

  // Reads to the end of the output, which comes when the program and all who share its output have ended;
  // gives the exit status, or minus the signal that ended it.
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

// Runs to the end: {exit status, output}.
std::pair<int, std::string> RunProgram(const std::string& program, std::vector<std::string> arguments);

// Processes whose command line holds both texts.
std::vector<pid_t> ProcessesOf(const std::string& program, const std::string& words);

// Waits until each of them has ended; false after `timeout`.
bool AllEndWithin(const std::vector<pid_t>& processes, absl::Duration timeout);

}  // namespace dbr
