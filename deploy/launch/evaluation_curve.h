// The evaluations of a run in their order, and what had been done when each policy was made.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "deploy/launch/monitor.h"

namespace dbr {

struct EvaluationPoint {
  std::string opponent;  // empty where the environment has none
  std::uint64_t policy_version = 0;
  std::uint64_t updates = 0;
  std::uint64_t steps = 0;  // transitions of the actors until then, as near as the launcher's questions tell
  std::uint64_t episodes = 0;
  double score_mean = std::numeric_limits<double>::quiet_NaN();  // NaN: the environment has no score
  double score_stderr = std::numeric_limits<double>::quiet_NaN();
  double return_mean = 0;
  double return_std = 0;                                  // over single episodes; NaN for one alone
  std::optional<std::uint64_t> iteration = std::nullopt;  // only in a run that is evaluated by updates
};

// Collects evaluations from the answers of the services, each once: of one policy (its version and its
// updates, for a version may come again after the learner's death) against one opponent there is one. A
// copyable value. One thread.
class EvaluationCurve {
 public:
  EvaluationCurve() = default;
  explicit EvaluationCurve(std::vector<EvaluationPoint> earlier, std::set<std::uint64_t> skipped = {});

  // Takes the evaluations that it does not know yet, and returns them in their order.
  std::vector<EvaluationPoint> Update(const RunSample& sample);

  const std::vector<EvaluationPoint>& points() const { return points_; }
  // The iterations that the evaluators have said to skip.
  const std::set<std::uint64_t>& skipped() const { return skipped_; }
  // The latest iteration that was evaluated; empty where none was, and in a run that is evaluated by time.
  std::optional<std::uint64_t> LastIteration() const;

  // The evaluation of the policy that an offline phase of that many updates ended with: the last one made
  // before any actor had acted, unless it was made before the last tenth of the phase and there is one soon
  // after. Empty where there is neither.
  std::optional<EvaluationPoint> AfterOffline(std::uint64_t offline_updates) const;
  // The evaluation with the lowest mean return of those made after the first transition of an actor; empty
  // where there is none.
  std::optional<EvaluationPoint> LowestOnline() const;

 private:
  struct Moment {
    std::uint64_t updates = 0;
    std::uint64_t steps = 0;
  };
  static constexpr std::size_t kMoments = 4096;  // more than half an hour of two questions a second

  void Remember(const RunSample& sample);
  // The actors' transitions when that many updates were made, on a straight line between the two moments
  // around it.
  std::uint64_t StepsAt(std::uint64_t updates) const;

  // Of a policy its version and its updates, and the opponent.
  using Key = std::tuple<std::uint64_t, std::uint64_t, std::string>;

  std::vector<EvaluationPoint> points_;
  std::set<Key> known_;  // of points_
  std::set<std::uint64_t> skipped_;
  std::deque<Moment> moments_;  // ascending
};

}  // namespace dbr
