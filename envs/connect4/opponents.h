// The players that a learning agent meets.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/rng.h"
#include "envs/connect4/board.h"

namespace dbr::connect4 {

// The names that MakeOpponent knows, for messages and help texts.
inline constexpr char kOpponentNames[] = "random, one_ply or mcts:N";

// A player. One thread at a time; it keeps nothing of a game from one move to the next that could change its
// play, so that one object serves many games.
class Opponent {
 public:
  virtual ~Opponent() = default;

  // A legal column. Requires a game that is not over.
  virtual int ChooseColumn(const Board& board, Rng& rng) = 0;
};

// Makes a player by its name:
//
// `random`: a uniformly drawn legal column.
//
// `one_ply`: a uniformly drawn column that wins at once; else one that blocks a win of the other side; else
// random.
//
// `mcts:N`: tree search (mcts.h) with N simulations a move, N from 1 to 1,000,000.
//
// InvalidArgument, naming these, for another name.
absl::StatusOr<std::unique_ptr<Opponent>> MakeOpponent(absl::string_view name);

}  // namespace dbr::connect4
