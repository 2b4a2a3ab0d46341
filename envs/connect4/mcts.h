// Monte Carlo tree search with random playouts: the opponent `mcts:N`.
#pragma once

#include <cstdint>
#include <vector>

#include "core/rng.h"
#include "envs/connect4/board.h"
#include "envs/connect4/playout.h"

namespace dbr::connect4 {

// UCT with exact values where the search has reached the end of the game. This is the fixed meaning of
// `mcts:N`:
//
// Simulations. Each move gets N simulations on a new tree. A simulation walks down from the root through
// nodes that were visited before. It ends at the first unvisited node with one uniformly random playout. So
// the first simulation is the root's own playout, and the other N - 1 add one node each. A node gets its
// children when a walk passes through it for the first time.
//
// Selection. The walk goes to the child with the greatest Q + 2 sqrt(ln(visits of the node) / visits of the
// child). Q in [-1, 1] is the mean outcome for the side that moves into the child. An unvisited child comes
// before every visited one. The order of the children is shuffled when they are made, and the first one wins
// a tie.
//
// Exact outcomes. A node where the game is over is proven. So is a node with a child that is a proven win for
// the side that moves there, and a node whose children are all proven (it has the best of them). A proven
// child counts in the walk with its exact outcome alone. A walk that reaches a proven node ends there. A
// proven root ends the search.
//
// The move. The search plays the child with the greatest proven outcome (0 while unproven). Among equals it
// takes the most visits, then the greatest sum of outcomes, then the first in the shuffled order. So it
// always plays a proven win and avoids a proven loss where it can.
//
// Memory: about 7 nodes of 16 bytes for each simulation, kept between moves. One thread at a time.
class TreeSearch {
 public:
  static constexpr int kMaxSimulations = 1'000'000;

  // Requires 1 <= simulations <= kMaxSimulations.
  explicit TreeSearch(int simulations);

  // Returns the column to play. Requires a game that is not over. O(simulations), each with one playout.
  int ChooseColumn(const Board& board, Rng& rng);

  // The number of walks of the last search that went into a column from the root.
  int Visits(int column) const;

 private:
  static constexpr std::int8_t kUnproven = 2;

  struct Node {
    std::int32_t first_child = 0;  // index of the first of `children` neighbours; 0: none
    std::int32_t visits = 0;
    std::int32_t outcomes = 0;       // the sum of the outcomes, for the side that moved into this node
    std::int8_t proven = kUnproven;  // the exact outcome for that side: -1, 0, 1
    std::int8_t children = 0;        // 0: not expanded yet
    std::int8_t landing_bit = 0;     // the cell of the move that leads from the parent to this node
  };

  void Simulate(Board board, ChoiceStream& choices);
  // Returns the outcome of a node that no walk has reached before, for the side that moved into it. Marks it
  // proven if the game is over.
  int FirstVisit(Node& node, const Board& board, ChoiceStream& choices);
  void Expand(std::int32_t index, const Board& board, ChoiceStream& choices);
  std::int32_t BestChild(const Node& node) const;
  bool ProveFromChildren(Node& node) const;
  std::int32_t ChildToPlay() const;

  const int simulations_;
  std::vector<float> exploration_;   // [n] 2 sqrt(ln n), for n visits of a node
  std::vector<float> inverse_root_;  // [n] 1 / sqrt(n)
  std::vector<Node> nodes_;          // the first is the root
  std::vector<std::int32_t> path_;   // the nodes of the current walk
};

}  // namespace dbr::connect4
