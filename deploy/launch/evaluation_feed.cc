#include "deploy/launch/evaluation_feed.h"

#include <algorithm>
#include <utility>

namespace dbr {

void EvaluationFeed::Read(const LearnerStatus& answer) {
  if (answer.life() == ended_life_ && ended_life_ != 0) return;  // it was long under way
  if (answer.life() != have_.life()) {
    ended_life_ = have_.life();
    have_.set_life(answer.life());
    have_.set_newest_report(0);
  }
  const auto count = static_cast<std::uint64_t>(answer.reports_size());
  std::uint64_t number = answer.newest_report() - std::min(count, answer.newest_report());
  if (number > have_.newest_report()) missed_ += number - have_.newest_report();
  for (const EvaluationReport& report : answer.reports()) {
    if (++number <= have_.newest_report()) continue;
    waiting_.push_back(report);
    have_.set_newest_report(number);
  }
}

std::vector<EvaluationReport> EvaluationFeed::Take() {
  return std::exchange(waiting_, {});
}

}  // namespace dbr
