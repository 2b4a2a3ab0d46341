#include "envs/connect4/opponents.h"

#include <bit>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "envs/connect4/mcts.h"
#include "envs/connect4/playout.h"

namespace dbr::connect4 {
namespace {

constexpr absl::string_view kMctsPrefix = "mcts:";

// Returns a uniformly drawn set bit of `columns`.
int DrawColumn(unsigned columns, Rng& rng) {
  return std::countr_zero(ChoiceStream(rng).SetBit(columns));
}

class RandomOpponent : public Opponent {
 public:
  int ChooseColumn(const Board& board, Rng& rng) override { return DrawColumn(board.LegalColumns(), rng); }
};

class OnePlyOpponent : public Opponent {
 public:
  int ChooseColumn(const Board& board, Rng& rng) override {
    if (const unsigned wins = board.WinningColumns(); wins != 0) return DrawColumn(wins, rng);
    if (const unsigned threats = board.ThreatenedColumns(); threats != 0) return DrawColumn(threats, rng);
    return DrawColumn(board.LegalColumns(), rng);
  }
};

class MctsOpponent : public Opponent {
 public:
  explicit MctsOpponent(int simulations) : search_(simulations) {}

  int ChooseColumn(const Board& board, Rng& rng) override { return search_.ChooseColumn(board, rng); }

 private:
  TreeSearch search_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Opponent>> MakeOpponent(absl::string_view name) {
  if (name == "random") return std::make_unique<RandomOpponent>();
  if (name == "one_ply") return std::make_unique<OnePlyOpponent>();
  int simulations = 0;
  if (absl::StartsWith(name, kMctsPrefix) &&
      absl::SimpleAtoi(name.substr(kMctsPrefix.size()), &simulations) && simulations >= 1 &&
      simulations <= TreeSearch::kMaxSimulations) {
    return std::make_unique<MctsOpponent>(simulations);
  }
  return absl::InvalidArgumentError(absl::StrCat("connect4: unknown opponent \"", name, "\"; expected ",
                                                 kOpponentNames, " with N from 1 to ",
                                                 TreeSearch::kMaxSimulations, " simulations a move"));
}

}  // namespace dbr::connect4
