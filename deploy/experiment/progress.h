// How far a cell is, and how long cells take.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "absl/time/time.h"
#include "deploy/experiment/grid.h"
#include "deploy/launch/run_summary.h"

namespace dbr {

// What is shown of a running cell, from the summary that its launch writes every ten seconds.
struct CellProgress {
  std::string phase;    // starting, offline, online, training, evaluating or saving
  std::string amount;   // "12,000 of 30,000 updates", by the limit that comes first; empty while starting
  double fraction = 0;  // how far it is to that limit, in [0, 1]
  std::string newest;   // the last evaluation: "return 812.3", "mcts:10 0.62"; empty before the first
  std::optional<absl::Duration> left;  // until its training ends; empty where nothing is known
};

// `summary` is what the launch under way has written, or a default one where it has written none yet.
CellProgress ProgressOf(const Config& config, const RunSummary& summary);

// How long finished cells took, by which others are estimated. A copyable value. One thread.
class CellDurations {
 public:
  // `whole` is the time from the cell's start to its end, over all of its launches.
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
