// The evaluators' reports on their way from the learner, each once.
#pragma once

#include <cstdint>
#include <vector>

#include "proto/policy.pb.h"

namespace dbr {

// Keeps the place up to which the learner's answers were read, through restarts of the learner, and the
// reports that nobody has taken yet. A copyable value. Thread-compatible.
class EvaluationFeed {
 public:
  // Says what is here, for the next question.
  const LearnerStatusRequest& have() const { return have_; }

  // Takes the reports of an answer that are new. An answer that comes late, to an older question, adds
  // nothing twice.
  void Read(const LearnerStatus& answer);

  // Hands over the reports since the last call, in the order in which the learner had them.
  std::vector<EvaluationReport> Take();

  // How many reports the learner has dropped, over all of its lives, before anybody asked for them.
  std::uint64_t missed() const { return missed_; }

 private:
  LearnerStatusRequest have_;
  std::vector<EvaluationReport> waiting_;
  std::uint64_t missed_ = 0;
  std::uint64_t ended_life_ = 0;  // of the learner before this one; 0: none
};

}  // namespace dbr
