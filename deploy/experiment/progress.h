// How far a cell is, and how long cells take.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "absl/time/time.h"
#include "deploy/experiment/grid.h"
#include "deploy/launch/run_summary.h"

namespace dbr {

// Read from the summary that a launch writes every ten seconds.
struct CellProgress {
  std::string phase;  // starting, offline, online, training, evaluating or saving
  std::string
      amount;  // "12,000 of 30,000 updates", of the limit that it will come to first; empty while starting
  double fraction = 0;  // of that
  std::string newest;   // the last evaluation: "return 812.3", "mcts:10 0.62"; empty before the first
  std::optional<absl::Duration> left;  // of its training; empty where nothing is known
};

// `summary`: of the launch under way, or a default one where it has written none yet.
CellProgress ProgressOf(const Config& config, const RunSummary& summary);

// What finished cells took, by which others are estimated. One thread.
class CellDurations {
 public:
  // `whole`: from its start to its end, over all launches.
  void Add(const Cell& cell, absl::Duration whole);

  // The mean of those nearest in kind: the same contender on the same task, else any on the task, else any of
  // the tasks' kind; empty where there is none.
  std::optional<absl::Duration> Expected(const Cell& cell) const;

 private:
  struct Sum {
    absl::Duration total;
    int count = 0;
  };
  std::map<std::string, Sum> sums_;
};

}  // namespace dbr
