// In which order the cells of a grid run, and how many at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "absl/time/time.h"
#include "proto/config.pb.h"

namespace dbr {

// What may run at once: `jobs` cells, or, where that is 0, as many as `cores` carry; one always.
struct Capacity {
  int jobs = 0;
  int cores = 1;
};

// What a cell needs for the schedule. `cost` is in cores.
struct CellDemand {
  std::uint32_t seed = 1;
  int cost = 1;
};

// How many cores a run of `config` keeps busy: one for each actor process, and one for the learner with its
// replay.
int CellCost(const Config& config);

// Hands out cells by their index in `demands`, which must come in the order of their seeds: no cell is handed
// out before every cell of the seeds before it has been. Where the next cell does not fit beside those that
// run, a later one of the same seed may go first. Copies are independent. One thread.
class Schedule {
 public:
  Schedule(std::vector<CellDemand> demands, Capacity capacity);

  // The next cell that may start now, which then counts as running; empty where none may.
  std::optional<std::size_t> Next();
  // Says that a running cell is over.
  void Finish(std::size_t cell);

  std::size_t waiting() const { return waiting_.size(); }
  int running() const { return running_; }

 private:
  bool Fits(std::size_t cell) const;

  std::vector<CellDemand> demands_;
  Capacity capacity_;
  std::deque<std::size_t> waiting_;
  int running_ = 0;
  int cores_taken_ = 0;
};

// How long `schedule` takes from now on, where each running cell takes the time that is left in `running`,
// and a waiting cell takes durations[cell]. O(n log n) for n cells of one cost.
struct RunningCell {
  std::size_t cell = 0;
  absl::Duration left;
};
absl::Duration TimeToFinish(Schedule schedule, const std::vector<RunningCell>& running,
                            const std::vector<absl::Duration>& durations);

}  // namespace dbr
