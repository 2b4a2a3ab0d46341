// What a policy says about Connect-4 positions, and how much of it is right.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "deploy/probe/positions_file.h"
#include "envs/connect4/board.h"
#include "nn/policy.h"

namespace dbr {

// One position. Columns count from 0. A network that the policy lacks has an empty list; else seven values,
// those of illegal columns meaningless.
struct ProbedPosition {
  connect4::Board board;
  int move = 0;  // the one that the policy plays
  std::vector<float> pi;
  std::vector<float> beta_plus;
  std::vector<float> beta_minus;
  std::vector<float> beta;  // for an algorithm with one behaviour policy
  std::vector<float> q;
};

// Asks the policy about all boards in one pass. InvalidArgument for a policy of another environment, a
// finished game, or a mode whose networks the policy lacks. `seed` is the random seed of the mode SAMPLE.
absl::StatusOr<std::vector<ProbedPosition>> Probe(const PolicyNetworks& policy,
                                                  absl::Span<const connect4::Board> boards, ActingMode mode,
                                                  std::uint64_t seed);

// Shares in [0, 1]; empty where there is no position of the kind.
struct ProbeShares {
  std::size_t positions = 0;
  std::optional<double> must_block;            // the share that is answered
  std::optional<double> must_win;              // the share that is answered
  std::optional<double> keeps_value_decisive;  // where a move can change the outcome
  std::optional<double> best;                  // among all positions
};

bool Contains(const std::vector<int>& columns, int column);

// How many of the moves are right. `probed[i]` must be the policy's answer to `positions[i]`.
ProbeShares ScoreMoves(absl::Span<const ReferencePosition> positions,
                       absl::Span<const ProbedPosition> probed);

}  // namespace dbr
