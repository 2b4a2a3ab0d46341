// Plays episodes to be kept, on every core.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "nn/policy.h"
#include "proto/config.pb.h"
#include "replay/dataset/episode.h"

namespace dbr {

struct RecordOptions {
  std::string env;
  std::shared_ptr<const PolicyNetworks> policy;  // null: actions are uniform in [-1, 1]
  ActingMode acting = MODE;                      // how the policy acts
  std::int64_t steps = 0;                        // at least 1
  std::uint64_t seed = 1;
  int threads = 0;  // 0: one for each core
};

// Where recorded episodes go. Both are called by the thread that called RecordEpisodes.
struct RecordSinks {
  std::function<absl::Status(const EpisodeView&)> episode;
  std::function<void(std::int64_t)> progress;  // steps played so far; several times a second
};

// Plays episodes 0, 1, 2, ... and hands them to `sinks.episode` in this order, options.steps steps in all:
// the last episode is cut where they end, and is then unfinished. Each episode has random seeds of its own,
// and episodes run in groups of a size that depends on options.steps alone, so that what comes out depends on
// env, policy, steps and seed, and not on the number of threads. An episode whose world failed ends as cut
// before the step that failed.
//
// Blocks; Cancelled soon after `cancelled` becomes true. Other errors: InvalidArgument for an unknown
// environment, one with discrete actions, or a policy that does not fit it (CheckPolicyFits) or has not the
// networks to act so; Internal for a
// policy that gives values that are not finite; errors of `sinks.episode`.
absl::Status RecordEpisodes(const RecordOptions& options, const RecordSinks& sinks,
                            const std::atomic<bool>& cancelled);

}  // namespace dbr
