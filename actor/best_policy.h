// The policy with the best evaluation that a run has had, in its file.
#pragma once

#include <limits>
#include <string>

#include "absl/status/status.h"
#include "core/policy_snapshot.h"
#include "proto/config.pb.h"

namespace dbr {

// Keeps the best policy of a run over all of its evaluators: the file says how good its policy was, and an
// evaluator that starts goes on from there. The figure is a mean over the opponents, of scores, else of
// returns; the greater one is better. The network "policy" in the file is the one that earned the figure, be
// it the raw policy of the learner or its average; the metadata say which. One thread at a time.
class BestPolicy {
 public:
  // Reads the file at `path`, where there is one; an empty path keeps nothing. `measure` says in words what
  // the figures are means over (MeasureOf). A file that is damaged, says no figure or one of another measure
  // is no rival: the log says so, and the next policy takes its place.
  BestPolicy(std::string path, std::string measure);

  // Writes the policy, as it played, where `mean` is greater than any before. `played` says which one it is.
  // Creates the folder. An error, which is logged, leaves the file as it was, and a later policy is compared
  // with that.
  void Offer(double mean, PolicyChoice played, const PolicySnapshot& snapshot);

  // Of the policy in the file; -infinity where there is none.
  double mean() const { return mean_; }

 private:
  absl::Status Read();
  absl::Status Write(double mean, PolicyChoice played, const PolicySnapshot& snapshot) const;

  const std::string path_;
  const std::string measure_;
  double mean_ = -std::numeric_limits<double>::infinity();
};

}  // namespace dbr
