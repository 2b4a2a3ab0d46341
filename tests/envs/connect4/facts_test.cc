// Tests the rules with the reference files.
#include <algorithm>
#include <bit>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/rng.h"
#include "envs/connect4/board.h"
#include "envs/connect4/opponents.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/envs/connect4/reference.h"

namespace dbr::connect4 {
namespace {

using nlohmann::json;

// The positions of one depth, each with the number of move sequences that lead to it.
struct Counted {
  Board board;
  std::int64_t sequences = 0;
};

std::pair<Cells, Cells> Key(const Board& board) {
  return {board.occupied(), board.mover()};
}

std::pair<Cells, Cells> MirroredKey(const Board& board) {
  const auto mirror = [](Cells cells) {
    Cells mirrored = 0;
    for (int column = 0; column < kColumns; ++column) {
      mirrored |= (cells >> (kColumnStride * column) & 0x7f) << (kColumnStride * (kColumns - 1 - column));
    }
    return mirrored;
  };
  return {mirror(board.occupied()), mirror(board.mover())};
}

std::vector<Counted> NextDepth(const std::vector<Counted>& positions) {
  std::vector<Counted> next;
  for (const Counted& position : positions) {
    if (position.board.IsOver()) continue;
    for (int column = 0; column < kColumns; ++column) {
      if (!position.board.IsLegal(column)) continue;
      next.push_back(position);
      next.back().board.Play(column);
    }
  }
  std::sort(next.begin(), next.end(),
            [](const Counted& a, const Counted& b) { return Key(a.board) < Key(b.board); });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < next.size(); ++i) {
    if (kept > 0 && next[kept - 1].board == next[i].board) {
      next[kept - 1].sequences += next[i].sequences;
    } else {
      next[kept++] = next[i];
    }
  }
  next.resize(kept);
  return next;
}

json Perft(const std::vector<Counted>& positions, int depth) {
  std::int64_t sequences = 0, winning_sequences = 0, won = 0, up_to_mirror = 0;
  for (const Counted& position : positions) {
    sequences += position.sequences;
    winning_sequences += position.board.LastMoveWon() ? position.sequences : 0;
    won += position.board.LastMoveWon();
    up_to_mirror += Key(position.board) <= MirroredKey(position.board);
  }
  return {{"depth", depth},
          {"sequences", sequences},
          {"sequences_ending_in_a_win", winning_sequences},
          {"distinct_positions", positions.size()},
          {"distinct_won_positions", won},
          {"distinct_up_to_mirror", up_to_mirror}};
}

TEST(Connect4Facts, PerftCountsAgree) {
  constexpr int kDeepest = 9;  // one depth more takes six times as long
  std::map<int, json> counted;
  std::vector<Counted> positions = {{Board(), 1}};
  for (int depth = 0; depth <= kDeepest; ++depth) {
    counted[depth] = Perft(positions, depth);
    positions = NextDepth(positions);
  }
  for (const json& file : ReadReferenceFiles("perft")) {
    int compared = 0;
    for (const json& expected : file.at("depths")) {
      const auto found = counted.find(expected.at("depth").get<int>());
      if (found == counted.end()) continue;
      EXPECT_EQ(found->second, expected);
      ++compared;
    }
    EXPECT_GT(compared, 0);
  }
}

// Expects that the facts of a position in the files agree with the board and its moves.
void ExpectFactsAgree(const json& position) {
  SCOPED_TRACE(position.at("id").get<std::string>());
  const absl::StatusOr<Board> board = Board::FromMoves(position.at("moves").get<std::string>());
  ASSERT_TRUE(board.ok()) << board.status();
  EXPECT_FALSE(board->IsOver());
  EXPECT_EQ(board->ply(), position.at("ply").get<int>());
  EXPECT_EQ(1 + board->ply() % 2, position.at("to_move").get<int>());
  unsigned legal = 0;
  for (const json& column : position.at("legal")) legal |= 1u << (column.get<int>() - 1);
  EXPECT_EQ(board->LegalColumns(), legal);
  for (int column = 0; column < kColumns; ++column) {
    const json& plies = position.at("plies_to_end").at(column);
    ASSERT_EQ(plies.is_null(), !board->IsLegal(column));
    if (plies.is_null() || position.at("result").at(column) == "D") continue;
    EXPECT_EQ(plies == 1, (board->WinningColumns() >> column & 1) == 1) << "column " << column + 1;
    Board next = *board;
    next.Play(column);
    EXPECT_EQ(plies == 2, !next.IsOver() && next.WinningColumns() != 0) << "column " << column + 1;
  }
}

TEST(Connect4Facts, PositionsAgreeOnLegalMovesAndOnMovesThatEndTheGame) {
  for (const json& position : ReadReferencePositions("positions")) ExpectFactsAgree(position);
}

TEST(Connect4Facts, TacticsAgreeOnWinsAndThreats) {
  for (const json& position : ReadReferencePositions("tactics")) {
    ExpectFactsAgree(position);
    SCOPED_TRACE(position.at("id").get<std::string>());
    const Board board = Board::FromMoves(position.at("moves").get<std::string>()).value();
    const unsigned answer = 1u << (position.at("answer").get<int>() - 1);
    EXPECT_EQ(std::popcount(board.ThreatenedColumns()), position.at("opponent_threats").get<int>());
    if (position.at("kind") == "must_win") {
      EXPECT_EQ(board.WinningColumns(), answer);
    } else {
      EXPECT_EQ(board.WinningColumns(), 0u);
      EXPECT_EQ(board.ThreatenedColumns(), answer);
    }
  }
}

// Returns the share of the tactics of one kind that a player answers with the right move.
double ShareAnswered(const std::string& player, const std::string& kind) {
  const auto opponent = MakeOpponent(player).value();
  Rng rng(21);
  int positions = 0, answered = 0;
  for (const json& position : ReadReferencePositions("tactics")) {
    if (position.at("kind") != kind) continue;
    const Board board = Board::FromMoves(position.at("moves").get<std::string>()).value();
    ++positions;
    answered += opponent->ChooseColumn(board, rng) + 1 == position.at("answer").get<int>();
  }
  EXPECT_GT(positions, 0);
  return static_cast<double>(answered) / positions;
}

TEST(Connect4Tactics, OnePlyAnswersAllOfThem) {
  EXPECT_EQ(ShareAnswered("one_ply", "must_win"), 1.0);
  EXPECT_EQ(ShareAnswered("one_ply", "must_block"), 1.0);
}

TEST(Connect4Tactics, SearchNeverMissesAWinAndSeldomAThreat) {
  EXPECT_EQ(ShareAnswered("mcts:10", "must_win"), 1.0);  // 9 visits reach every child
  EXPECT_EQ(ShareAnswered("mcts:1000", "must_win"), 1.0);
  EXPECT_GE(ShareAnswered("mcts:1000", "must_block"), 0.95);
}

}  // namespace
}  // namespace dbr::connect4
