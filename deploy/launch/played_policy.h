// The policy that a user names to be played: the newest of a run, raw or averaged, or the run's best.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nn/policy.h"

namespace dbr {

enum class PlayedChoice {
  kRaw,      // the newest policy, as the actors use it
  kAverage,  // the average of the newest policy
  kBest,     // the policy of the run's best evaluation, as it played there
};

// "raw", "average" or "best".
absl::string_view NameOf(PlayedChoice choice);

struct PlayedPolicy {
  std::shared_ptr<const PolicyNetworks> networks;  // its "policy" is the one that was chosen
  PlayedChoice choice = PlayedChoice::kRaw;
};

// Reads the policy of a file or of a run folder. Without `choice`, it is the one that the run's config says
// (evaluation.which), and of a file the average; where the policy has no average, the raw one.
//
// NotFound where the run has no such policy; InvalidArgument for kAverage where the policy has no average and
// for kBest where a file is named; the errors of reading the policy and of reading the run's config. The
// messages name the file.
absl::StatusOr<PlayedPolicy> OpenPlayedPolicy(const std::string& file_or_run,
                                              std::optional<PlayedChoice> choice);

}  // namespace dbr
