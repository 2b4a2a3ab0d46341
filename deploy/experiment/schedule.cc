#include "deploy/experiment/schedule.h"

#include <algorithm>
#include <queue>
#include <utility>

#include "deploy/launch/run_plan.h"

namespace dbr {

int CellCost(const Config& config) {
  return 1 + ActorProcesses(config);
}

Schedule::Schedule(std::vector<CellDemand> demands, Capacity capacity)
    : demands_(std::move(demands)), capacity_(capacity) {
  for (std::size_t cell = 0; cell < demands_.size(); ++cell) waiting_.push_back(cell);
}

bool Schedule::Fits(std::size_t cell) const {
  if (running_ == 0) return true;
  if (capacity_.jobs > 0) return running_ < capacity_.jobs;
  return cores_taken_ + demands_[cell].cost <= capacity_.cores;
}

std::optional<std::size_t> Schedule::Next() {
  for (auto next = waiting_.begin(); next != waiting_.end(); ++next) {
    const std::size_t cell = *next;
    if (demands_[cell].seed != demands_[waiting_.front()].seed) break;
    if (!Fits(cell)) continue;
    waiting_.erase(next);
    ++running_;
    cores_taken_ += demands_[cell].cost;
    return cell;
  }
  return std::nullopt;
}

void Schedule::Finish(std::size_t cell) {
  --running_;
  cores_taken_ -= demands_[cell].cost;
}

absl::Duration TimeToFinish(Schedule schedule, const std::vector<RunningCell>& running,
                            const std::vector<absl::Duration>& durations) {
  using Ending = std::pair<absl::Duration, std::size_t>;  // when, which
  std::priority_queue<Ending, std::vector<Ending>, std::greater<>> endings;
  for (const RunningCell& one : running) endings.push({one.left, one.cell});
  absl::Duration now;
  for (;;) {
    while (const std::optional<std::size_t> next = schedule.Next())
      endings.push({now + durations[*next], *next});
    if (endings.empty()) return now;
    now = endings.top().first;
    schedule.Finish(endings.top().second);
    endings.pop();
  }
}

}  // namespace dbr
