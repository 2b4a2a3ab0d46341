// How well a policy plays: many whole episodes with figures that can be repeated.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "nn/policy.h"
#include "proto/config.pb.h"

namespace dbr {

// An evaluation has this many episodes at most: more would run into the next seed's episodes.
inline constexpr int kMaxEpisodes = 1 << 20;

// That many episodes are played side by side, with one forward pass a step.
inline constexpr int kEvaluationColumns = 64;

struct EvaluationOptions {
  std::string opponent;  // empty where the environment has none
  int episodes = 1000;
  std::uint64_t seed = 1;
  ActingMode mode = MODE;
  int threads = 0;  // 0: one for each core. The result is the same for every number
};

struct EvaluationResult {
  std::string env;
  std::string opponent;
  int episodes = 0;
  std::uint64_t seed = 0;
  double score_mean = 0;  // NaN, and its error too, where the environment has no score
  double score_stderr = 0;
  double return_mean = 0;  // an episode's return is the undiscounted sum of its rewards
  double return_stderr = 0;
  double return_std = 0;  // over single episodes; NaN for one alone
  double return_min = 0;
  double return_max = 0;
  double length_mean = 0;  // steps of the agent in an episode
};

// Plays exactly options.episodes episodes. Episode k has the environment seed `seed * kMaxEpisodes + k`, so
// that in a two-player game the sides start in turn, the agent first. Episodes run in groups of
// kEvaluationColumns with one random stream a group: the result depends on the policy, the seed and the mode
// alone, to the last bit on one kind of processor, and the first n episodes of a longer evaluation are those
// of a shorter one.
//
// Blocks until all are played, or ends with Cancelled soon after `cancelled` (may be null) becomes true.
// Other errors: InvalidArgument for an unknown environment or opponent, a policy that does not fit the
// environment, a mode whose networks the policy lacks, or a number of episodes outside [1, kMaxEpisodes];
// Internal for a policy that gives values that are not finite.
absl::StatusOr<EvaluationResult> Evaluate(const PolicyNetworks& policy, const EvaluationOptions& options,
                                          const std::atomic<bool>* cancelled = nullptr);

// The results of Evaluate() against each of `opponents` in turn, in place of options.opponent; {""} stands
// for an environment without opponents. The first error ends it.
absl::StatusOr<std::vector<EvaluationResult>> EvaluateAgainst(const PolicyNetworks& policy,
                                                              const std::vector<std::string>& opponents,
                                                              EvaluationOptions options,
                                                              const std::atomic<bool>* cancelled = nullptr);

// A mean and its standard error sqrt(sum (x - mean)^2 / (n - 1) / n): NaN for a single value, both NaN for
// none.
struct MeanEstimate {
  double mean = 0;
  double standard_error = 0;
};
MeanEstimate EstimateMean(absl::Span<const double> values);

}  // namespace dbr
