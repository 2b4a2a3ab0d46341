// Tests random playouts, the opponents and their strength.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/rng.h"
#include "envs/connect4/board.h"
#include "envs/connect4/mcts.h"
#include "envs/connect4/opponents.h"
#include "envs/connect4/playout.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr::connect4 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(NthSetBit, SkipsTheBitsBelow) {
  constexpr std::uint64_t kBits = 0x8000200800014102u;
  constexpr std::uint64_t kExpected[] = {
      0x2, 0x100, 0x4000, 0x10000, 0x800000000, 0x200000000000, 0x8000000000000000u};
  for (unsigned n = 0; n < std::popcount(kBits); ++n) {
    EXPECT_EQ(NthSetBit(kBits, n), kExpected[n]) << n;
    EXPECT_EQ(NthSetBitByLoop(kBits, n), kExpected[n]) << n;
  }
}

// One draw serves eight choices. Each of the eight must be uniform for any number of set bits.
TEST(ChoiceStream, IsUniformInEachOfItsEightPlaces) {
  constexpr int kDraws = 70000;
  for (int n = 1; n <= kColumns; ++n) {
    Rng rng(31 + n);
    ChoiceStream choices(rng);
    std::array<std::array<int, kColumns>, 8> counts = {};
    for (int draw = 0; draw < 8 * kDraws; ++draw) {
      ++counts[draw % 8][std::countr_zero(choices.SetBit((std::uint64_t{1} << n) - 1))];
    }
    const double expected = static_cast<double>(kDraws) / n;
    for (const auto& place : counts) {
      for (int bit = 0; bit < n; ++bit)
        EXPECT_NEAR(place[bit], expected, 5 * std::sqrt(expected)) << "of " << n;
    }
  }
}

TEST(ChoiceStream, NeighbouringChoicesAreIndependent) {
  constexpr int kPairs = 490000;
  Rng rng(41);
  ChoiceStream choices(rng);
  std::array<int, 49> counts = {};
  const auto draw = [&choices] { return std::countr_zero(choices.SetBit(0x7f)); };
  for (int pair = 0; pair < kPairs; ++pair) {
    const int first = draw();
    ++counts[7 * first + draw()];
  }
  for (const int count : counts) EXPECT_NEAR(count, kPairs / 49.0, 5 * std::sqrt(kPairs / 49.0));
}

TEST(RandomPlayout, FromTheEmptyBoardHasTheKnownShares) {
  constexpr int kGames = 400000;
  Rng rng(42);
  ChoiceStream choices(rng);
  int wins = 0, draws = 0;
  for (int game = 0; game < kGames; ++game) {
    const int outcome = RandomPlayout(Board(), choices);
    wins += outcome == 1;
    draws += outcome == 0;
  }
  EXPECT_NEAR(static_cast<double>(wins) / kGames, 0.5558, 0.004);
  EXPECT_NEAR(static_cast<double>(draws) / kGames, 0.0026, 0.0005);
}

// Returns the expectation of a random playout for the side to move, by playing every game.
double ExactPlayoutMean(const Board& board) {
  double sum = 0;
  for (int column = 0; column < kColumns; ++column) {
    if (!board.IsLegal(column)) continue;
    Board next = board;
    next.Play(column);
    sum += next.LastMoveWon() ? 1 : next.IsFull() ? 0 : -ExactPlayoutMean(next);
  }
  return sum / std::popcount(board.LegalColumns());
}

TEST(RandomPlayout, AgreesWithTheExactExpectationInLatePositions) {
  constexpr int kPlayouts = 40000;
  Rng rng(43);
  ChoiceStream choices(rng);
  for (int tried = 0; tried < 10;) {
    Board board;
    while (!board.IsOver() && board.ply() < 33) board.PlayCell(choices.SetBit(board.landing_cells()));
    if (board.IsOver()) continue;
    ++tried;
    int sum = 0;
    for (int i = 0; i < kPlayouts; ++i) sum += RandomPlayout(board, choices);
    EXPECT_NEAR(static_cast<double>(sum) / kPlayouts, ExactPlayoutMean(board), 5 / std::sqrt(kPlayouts));
  }
}

TEST(RandomOpponent, PlaysEveryLegalColumnEquallyOften) {
  constexpr int kMoves = 60000;
  const auto random = MakeOpponent("random").value();
  const Board board = Board::FromMoves("222222").value();
  Rng rng(44);
  std::array<int, kColumns> counts = {};
  for (int move = 0; move < kMoves; ++move) ++counts[random->ChooseColumn(board, rng)];
  EXPECT_EQ(counts[1], 0);
  for (const int column : {0, 2, 3, 4, 5, 6}) EXPECT_NEAR(counts[column], 10000, 500) << column;
}

TEST(OnePlyOpponent, PrefersItsWinToABlock) {
  const auto one_ply = MakeOpponent("one_ply").value();
  const Board board = Board::FromMoves("171717").value();  // both sides have three in a column
  Rng rng(45);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(one_ply->ChooseColumn(board, rng), 0);
}

TEST(OnePlyOpponent, PicksAmongSeveralBlocksAndElseAtRandom) {
  const auto one_ply = MakeOpponent("one_ply").value();
  Rng rng(46);
  std::array<int, kColumns> blocks = {};
  std::array<int, kColumns> openings = {};
  for (int i = 0; i < 1000; ++i) {
    ++blocks[one_ply->ChooseColumn(Board::FromMoves("33445").value(), rng)];
    ++openings[one_ply->ChooseColumn(Board(), rng)];
  }
  EXPECT_EQ(blocks[1] + blocks[5], 1000);
  EXPECT_NEAR(blocks[1], 500, 80);
  for (const int count : openings) EXPECT_NEAR(count, 143, 60);
}

TEST(TreeSearch, WithTheSameSeedPlaysTheSameMoves) {
  TreeSearch first(200);
  TreeSearch second(200);
  Rng other(7);
  second.ChooseColumn(Board(), other);  // an earlier search must not change a later one
  Rng rng_a(47);
  Rng rng_b(47);
  for (Board board; !board.IsOver();) {
    const int column = first.ChooseColumn(board, rng_a);
    ASSERT_EQ(second.ChooseColumn(board, rng_b), column);
    ASSERT_TRUE(board.IsLegal(column));
    board.Play(column);
  }
  EXPECT_EQ(rng_a.state(), rng_b.state());
}

TEST(TreeSearch, ASingleSimulationPlaysAnyColumn) {
  TreeSearch search(1);
  Rng rng(48);
  std::array<int, kColumns> counts = {};
  for (int move = 0; move < 7000; ++move) ++counts[search.ChooseColumn(Board(), rng)];
  for (const int count : counts) EXPECT_NEAR(count, 1000, 150);
}

// A player's strength hardly depends on its exploration constant, but the spread of its visits does. The
// share of the middle column is 0.40 with c = 1.4 and 0.25 with c = 2.8 (as with c = 1.4 and outcomes counted
// from 0 to 1).
TEST(TreeSearch, SpreadsItsVisitsAsTheExplorationConstantSays) {
  constexpr int kSearches = 300;
  constexpr int kSimulations = 1000;
  TreeSearch search(kSimulations);
  Rng rng(50);
  int middle = 0;
  for (int i = 0; i < kSearches; ++i) {
    search.ChooseColumn(Board(), rng);
    int visits = 0;
    for (int column = 0; column < kColumns; ++column) visits += search.Visits(column);
    ASSERT_EQ(visits, kSimulations - 1);  // the first simulation is the root's own playout
    middle += search.Visits(3);
  }
  EXPECT_NEAR(static_cast<double>(middle) / kSearches / kSimulations, 0.303, 0.025);
}

TEST(TreeSearch, FindsTheOnlyOpeningThatWinsGivenTime) {
  TreeSearch search(20000);
  Rng rng(49);
  EXPECT_EQ(search.ChooseColumn(Board(), rng), 3);
}

TEST(MakeOpponent, NamesTheKnownOnesForAnUnknownName) {
  for (const char* name :
       {"", "rand", "mcts", "mcts:", "mcts:0", "mcts:-3", "mcts:1000001", "mcts:ten", "mcts:10x"}) {
    const absl::Status status = MakeOpponent(name).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << name;
    EXPECT_THAT(std::string(status.message()),
                AllOf(HasSubstr(absl::StrCat("\"", name, "\"")), HasSubstr("random"), HasSubstr("one_ply"),
                      HasSubstr("mcts:N")));
  }
}

// Returns the mean score of a player against random over 2,000 games. The starting side alternates.
double ScoreAgainstRandom(const std::string& name, std::uint64_t seed) {
  constexpr int kGames = 2000;
  const auto player = MakeOpponent(name).value();
  const auto random = MakeOpponent("random").value();
  Rng rng(seed);
  double score = 0;
  for (int game = 0; game < kGames; ++game) {
    Board board;
    bool players_turn = game % 2 == 0;
    for (; !board.IsOver(); players_turn = !players_turn) {
      board.Play((players_turn ? *player : *random).ChooseColumn(board, rng));
    }
    score += !board.LastMoveWon() ? 0.5 : players_turn ? 0 : 1;
  }
  return score / kGames;
}

TEST(Calibration, RandomAgainstRandom) {
  EXPECT_NEAR(ScoreAgainstRandom("random", 1), 0.505, 0.02);
}
TEST(Calibration, OnePlyAgainstRandom) {
  EXPECT_NEAR(ScoreAgainstRandom("one_ply", 1), 0.963, 0.01);
}
TEST(Calibration, Mcts10AgainstRandom) {
  EXPECT_NEAR(ScoreAgainstRandom("mcts:10", 1), 0.885, 0.02);
}
TEST(Calibration, Mcts100AgainstRandom) {
  EXPECT_GE(ScoreAgainstRandom("mcts:100", 1), 0.99);
}

}  // namespace
}  // namespace dbr::connect4
