#include "envs/connect4/env.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/check.h"
#include "core/status_macros.h"
#include "envs/connect4/playout.h"

namespace dbr::connect4 {
namespace {

// Returns the column of an action, or -1 where the action is not a column.
int ColumnOf(absl::Span<const float> action) {
  DBR_CHECK(action.size() == 1);
  const float column = action[0];
  return column >= 0 && column < kColumns && column == std::floor(column) ? static_cast<int>(column) : -1;
}

// Returns the result of an episode's last step. `outcome` is 1, 0 or -1 for the agent.
StepResult LastStep(int outcome) {
  StepResult result;
  result.reward = static_cast<float>(outcome);
  result.terminated = true;
  result.score = 0.5f * static_cast<float>(outcome + 1);
  return result;
}

// Returns a position of a game of random moves, before its last move, with each number of moves as likely as
// any other. The empty board is one of them.
Board RandomStart(Rng& rng) {
  std::array<Board, kCells> positions;
  std::uint32_t count = 0;
  ChoiceStream choices(rng);
  for (Board board; !board.IsOver(); board.PlayCell(choices.SetBit(board.landing_cells())))
    positions[count++] = board;
  return positions[rng.Below(count)];
}

}  // namespace

absl::StatusOr<std::unique_ptr<Env>> Connect4Env::Make(const std::vector<std::string>& names,
                                                       double random_start_share) {
  std::vector<std::unique_ptr<Opponent>> opponents;
  for (const std::string& name : names.empty() ? std::vector<std::string>{"random"} : names) {
    ASSIGN_OR_RETURN(opponents.emplace_back(), MakeOpponent(name));
  }
  return std::unique_ptr<Env>(new Connect4Env(std::move(opponents), random_start_share));
}

Connect4Env::Connect4Env(std::vector<std::unique_ptr<Opponent>> opponents, double random_start_share)
    : spec_{.name = "connect4",
            .observation_size = kObservationSize,
            .actions = {ActionKind::kDiscrete, kColumns},
            .max_episode_steps = kCells / 2,
            .has_score = true,
            .symmetry = MirrorImage()},
      opponents_(std::move(opponents)),
      random_start_share_(random_start_share) {}

void Connect4Env::Reset(std::uint64_t seed, absl::Span<float> observation, absl::Span<float> mask) {
  rng_ = Rng(seed);
  opponent_ = opponents_[rng_.Below(static_cast<std::uint32_t>(opponents_.size()))].get();
  if (random_start_share_ > 0 && rng_.Uniform() < random_start_share_) {
    board_ = RandomStart(rng_);
  } else {
    board_ = Board();
    if (seed % 2 == 1) board_.Play(opponent_->ChooseColumn(board_, rng_));
  }
  WriteObservation(board_, observation, mask);
}

StepResult Connect4Env::Step(absl::Span<const float> action, absl::Span<float> observation,
                             absl::Span<float> mask) {
  DBR_CHECK(opponent_ != nullptr);  // requires Reset
  const int column = ColumnOf(action);
  DBR_CHECK(board_.IsLegal(column));  // no column is legal once the episode has ended
  board_.Play(column);
  const bool ended_by_agent = board_.IsOver();
  if (!ended_by_agent) board_.Play(opponent_->ChooseColumn(board_, rng_));
  if (!board_.IsOver()) {
    WriteObservation(board_, observation, mask);
    return StepResult();
  }
  DBR_CHECK(mask.size() == kColumns);
  std::fill(mask.begin(), mask.end(), 0.0f);
  const Cells own = ended_by_agent ? board_.other() : board_.mover();
  WritePlanes(own, own ^ board_.occupied(), observation);
  if (!board_.LastMoveWon()) return LastStep(0);
  return LastStep(ended_by_agent ? 1 : -1);
}

}  // namespace dbr::connect4
