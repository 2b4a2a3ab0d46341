// A whole grid of runs: started, watched, ended.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "deploy/experiment/cell.h"
#include "deploy/experiment/grid.h"
#include "deploy/experiment/progress.h"
#include "deploy/experiment/schedule.h"
#include "deploy/experiment/status_screen.h"
#include "deploy/process/supervisor.h"

namespace dbr {

struct ExperimentOptions {
  std::string programs;  // the folder of `dbr`
  Capacity capacity;
  // False: what only continuing a run would need is removed when the run is done.
  bool keep_stores = false;
  // True: runs of another config are moved aside and started anew; false: they are left alone.
  bool overwrite_changed = false;
};

// Runs the cells of one grid once, from the main thread. What the user sees goes to `out`, which must outlive
// it.
class ExperimentRun {
 public:
  ExperimentRun(Grid grid, ExperimentOptions options, Output* out);

  // Starts `dbr launch` for each cell that is not done, as many at once as the capacity has room for, until
  // all are over or a signal comes, upon which the running ones are told to save and stop. Blocks. Returns
  // the exit status: 0, 1 where a cell failed or was left alone, or 130 after a signal. Returns an error
  // where nothing could be run at all.
  absl::StatusOr<int> Run();

 private:
  enum class Outcome { kWaiting, kRunning, kDone, kFailed, kLeftAlone };
  struct Entry {
    Cell cell;
    Outcome outcome = Outcome::kWaiting;
    RunSummary before;                             // what earlier launches of the run came to
    RunSummary newest;                             // what the launch under way has written
    std::filesystem::file_time_type read_at = {};  // the age of the file that `newest` was read from
    absl::Time started = absl::InfiniteFuture();
  };

  void Survey();
  void Announce();
  bool Settle(Entry* entry, const CellStanding& standing);
  void StartDue();
  absl::Status Start(Entry* entry);
  absl::Status Launch(const Cell& cell, bool resume);
  void TakeEnded();
  void Judge(Entry* entry, const EndedProcess& ended);
  void Fail(Entry* entry, const std::string& why);

  void ReadProgress();
  GridStatus State() const;
  std::optional<absl::Duration> TimeLeft() const;
  int Count(Outcome outcome) const;
  int Conclude(bool signalled);

  const std::string title_;  // "experiment paper at scale short"
  const std::string run_dir_;
  const ExperimentOptions options_;
  StatusScreen screen_;
  std::vector<Entry> entries_;
  std::map<std::string, std::size_t> running_;  // entries by the cell's name
  std::unique_ptr<Schedule> schedule_;          // over all entries
  CellDurations durations_;
  std::unique_ptr<Supervisor> supervisor_;
};

}  // namespace dbr
