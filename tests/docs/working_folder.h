// The folder in which a page's commands are run.
#pragma once

#include <string>
#include <utility>

#include "tests/support/temp_dir.h"

namespace dbr {

// A folder of its own in which `build/bin` and `deploy` are there as in a built tree. The programs are the
// real ones, but for three commands of build/bin/dbr, which take minutes for a reader and must not for a test
// (kWrapper in the .cc):
//   launch:         the same command with shorter limits behind it;
//   dataset record: 5,000 steps in place of what --steps says;
//   stats:          asks again until the run answers that the command before has just started.
// Made for one test; one thread.
class WorkingFolder {
 public:
  WorkingFolder();

  // Runs bash over `script` within the folder: exit status and all output. Processes that are left after
  // `timeout_s` seconds are told to end.
  std::pair<int, std::string> Run(const std::string& script, int timeout_s) const;

  // Whether a file is there and is not empty.
  bool Holds(const std::string& path) const;

 private:
  const TempDir folder_;
};

}  // namespace dbr
