// The players that a learning agent plays against.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/rng.h"
#include "envs/connect4/board.h"

namespace dbr::connect4 {

// The names that MakeOpponent knows, for messages and help texts.
inline constexpr char kOpponentNames[] = "random, one_ply or mcts:N";

// A player. One thread at a time. It keeps nothing from one move to the next that could change its play, so
// that one object serves many games.
class Opponent {
 public:
  virtual ~Opponent() = default;

  // Returns a legal column. Requires a game that is not over.
  virtual int ChooseColumn(const Board& board, Rng& rng) = 0;
};

// Makes a player by its name:
//
// `random`: a uniformly drawn legal column.
//
// `one_ply`: a uniformly drawn column that wins at once. Without one, a column that blocks a win of the other
// side. Without one, a random column.
//
// `mcts:N`: tree search (mcts.h) with N simulations a move, N from 1 to 1,000,000.
//
// Returns InvalidArgument, with these names, for another name.
absl::StatusOr<std::unique_ptr<Opponent>> MakeOpponent(absl::string_view name);

}  // namespace dbr::connect4
