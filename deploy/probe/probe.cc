#include "deploy/probe/probe.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/rng.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

using connect4::kColumns;
using connect4::kObservationSize;

std::vector<float> Column(const MatrixX<float>& values, Eigen::Index column) {
  if (values.size() == 0) return {};
  return {values.col(column).data(), values.col(column).data() + values.rows()};
}

absl::Status CheckProbable(const PolicyNetworks& policy, absl::Span<const connect4::Board> boards) {
  const PolicySpec& spec = policy.spec();
  if (spec.observation_size != kObservationSize || !spec.actions.discrete() ||
      spec.actions.size != kColumns) {
    return absl::InvalidArgumentError(absl::StrCat(
        "positions are of connect4, the policy is for '", spec.env, "' with ", spec.observation_size,
        " observations and ", spec.actions.size, " actions: choose a policy that plays connect4"));
  }
  for (const connect4::Board& board : boards) {
    if (board.IsOver()) {
      return absl::InvalidArgumentError(absl::StrCat("a game that ended with move ", board.ply(),
                                                     ": expected a position with a move to play"));
    }
  }
  return absl::OkStatus();
}

// Counts answers of one kind.
struct Tally {
  int asked = 0;
  int right = 0;
  void Add(bool is_right) {
    ++asked;
    right += is_right ? 1 : 0;
  }
  std::optional<double> share() const {
    if (asked == 0) return std::nullopt;
    return static_cast<double>(right) / asked;
  }
};

}  // namespace

absl::StatusOr<std::vector<ProbedPosition>> Probe(const PolicyNetworks& policy,
                                                  absl::Span<const connect4::Board> boards, ActingMode mode,
                                                  std::uint64_t seed) {
  RETURN_IF_ERROR(CheckProbable(policy, boards));
  const auto n = static_cast<Eigen::Index>(boards.size());
  MatrixX<float> observations(kObservationSize, n);
  MatrixX<float> masks(kColumns, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    connect4::WriteObservation(boards[i], {observations.col(i).data(), kObservationSize},
                               {masks.col(i).data(), kColumns});
  }
  PolicyRunner runner;
  Rng rng(seed);
  MatrixX<float> moves(1, n);
  RETURN_IF_ERROR(runner.Act(policy, mode, observations, masks, rng, moves));
  const PolicyView& view = runner.View(policy, observations, masks);
  std::vector<ProbedPosition> probed(boards.size());
  for (Eigen::Index i = 0; i < n; ++i) {
    probed[i] = {boards[i],
                 static_cast<int>(moves(0, i)),
                 Column(view.policy, i),
                 Column(view.beta_plus, i),
                 Column(view.beta_minus, i),
                 Column(view.beta, i),
                 Column(view.q, i)};
  }
  return probed;
}

bool Contains(const std::vector<int>& columns, int column) {
  return std::find(columns.begin(), columns.end(), column) != columns.end();
}

ProbeShares ScoreMoves(absl::Span<const ReferencePosition> positions,
                       absl::Span<const ProbedPosition> probed) {
  Tally must_block, must_win, keeps_value, best;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const ReferencePosition& position = positions[i];
    const int column = probed[i].move + 1;
    if (position.kind == "must_block") must_block.Add(column == position.answer);
    if (position.kind == "must_win") must_win.Add(column == position.answer);
    if (position.decisive()) keeps_value.Add(Contains(position.keeps_value, column));
    best.Add(Contains(position.best, column));
  }
  return {positions.size(), must_block.share(), must_win.share(), keeps_value.share(), best.share()};
}

}  // namespace dbr
