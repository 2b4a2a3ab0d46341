#include "envs/connect4/board.h"

#include <array>
#include <bit>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/rng.h"
#include "envs/connect4/playout.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr::connect4 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Exchanges left and right.
Cells Mirror(Cells cells) {
  Cells mirrored = 0;
  for (int column = 0; column < kColumns; ++column) {
    const Cells stones = cells >> (kColumnStride * column) & 0x7f;
    mirrored |= stones << (kColumnStride * (kColumns - 1 - column));
  }
  return mirrored;
}

// The rule in its plain form: from a cell, in a direction, four stones.
bool HasFourByLines(Cells stones) {
  const auto has = [stones](int column, int row) {
    return column >= 0 && column < kColumns && row >= 0 && row < kRows && (stones & Cell(column, row)) != 0;
  };
  constexpr int kDirections[][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
  for (int column = 0; column < kColumns; ++column) {
    for (int row = 0; row < kRows; ++row) {
      for (const auto [right, up] : kDirections) {
        int length = 0;
        while (length < 4 && has(column + length * right, row + length * up)) ++length;
        if (length == 4) return true;
      }
    }
  }
  return false;
}

std::vector<Cells> AllCells() {
  std::vector<Cells> cells;
  for (int column = 0; column < kColumns; ++column) {
    for (int row = 0; row < kRows; ++row) cells.push_back(Cell(column, row));
  }
  return cells;
}

Board Played(absl::string_view moves) {
  const absl::StatusOr<Board> board = Board::FromMoves(moves);
  EXPECT_TRUE(board.ok()) << board.status();
  return board.value_or(Board());
}

TEST(HasFour, KnowsExactlyThe69Lines) {
  const std::vector<Cells> cells = AllCells();
  int lines = 0;
  for (std::size_t a = 0; a < cells.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      for (std::size_t c = 0; c < b; ++c) {
        for (std::size_t d = 0; d < c; ++d) {
          const Cells stones = cells[a] | cells[b] | cells[c] | cells[d];
          lines += HasFour(stones);
          ASSERT_EQ(HasFour(stones), HasFourByLines(stones)) << std::hex << stones;
        }
      }
    }
  }
  EXPECT_EQ(lines, 69);
}

TEST(HasFour, AgreesWithTheRuleAndWithItsMirrorImageOnRandomStones) {
  Rng rng(11);
  int wins = 0;
  for (int i = 0; i < 20000; ++i) {
    const Cells stones = rng() & rng() & kAllCells;
    wins += HasFour(stones);
    ASSERT_EQ(HasFour(stones), HasFourByLines(stones)) << std::hex << stones;
    ASSERT_EQ(HasFour(stones), HasFour(Mirror(stones))) << std::hex << stones;
  }
  EXPECT_GT(wins, 1000);
  EXPECT_LT(wins, 19000);
}

TEST(Board, MirroredGamesGiveMirroredPositions) {
  Rng rng(12);
  for (int game = 0; game < 500; ++game) {
    Board board;
    Board mirrored;
    while (!board.IsOver()) {
      const int column = std::countr_zero(ChoiceStream(rng).SetBit(board.LegalColumns()));
      board.Play(column);
      mirrored.Play(kColumns - 1 - column);
      ASSERT_EQ(mirrored.occupied(), Mirror(board.occupied()));
      ASSERT_EQ(mirrored.mover(), Mirror(board.mover()));
      ASSERT_EQ(mirrored.IsOver(), board.IsOver());
      ASSERT_EQ(mirrored.LastMoveWon(), board.LastMoveWon());
    }
  }
}

TEST(Board, TakesTurnsAndStacksStones) {
  const Board board = Played("4453");
  EXPECT_EQ(board.ply(), 4);
  EXPECT_EQ(board.mover(), Cell(3, 0) | Cell(4, 0));
  EXPECT_EQ(board.other(), Cell(3, 1) | Cell(2, 0));
  EXPECT_EQ(board.landing_cells(),
            Cell(0, 0) | Cell(1, 0) | Cell(2, 1) | Cell(3, 2) | Cell(4, 1) | Cell(5, 0) | Cell(6, 0));
}

TEST(Board, AFullColumnIsNotLegal) {
  const Board board = Played("111111");
  EXPECT_FALSE(board.IsLegal(0));
  EXPECT_TRUE(board.IsLegal(1));
  EXPECT_FALSE(board.IsLegal(-1));
  EXPECT_FALSE(board.IsLegal(kColumns));
  EXPECT_EQ(board.LegalColumns(), 0b1111110u);
}

TEST(Board, NothingIsLegalOnceTheGameIsWon) {
  const Board board = Played("1212121");
  EXPECT_TRUE(board.LastMoveWon());
  EXPECT_TRUE(board.IsOver());
  EXPECT_EQ(board.LegalColumns(), 0u);
  for (int column = 0; column < kColumns; ++column) EXPECT_FALSE(board.IsLegal(column));
}

TEST(Board, AFullBoardWithoutALineIsADraw) {
  const Board board = Played("121212212121343434434343565656656565777777");
  EXPECT_TRUE(board.IsFull());
  EXPECT_FALSE(board.LastMoveWon());
  EXPECT_TRUE(board.IsOver());
  EXPECT_EQ(board.ply(), kCells);
}

TEST(Board, FindsWinsAndThreats) {
  const Board both_ends = Played("33445");  // 3, 4 and 5 in the bottom row, open at both ends
  EXPECT_EQ(both_ends.WinningColumns(), 0u);
  EXPECT_EQ(both_ends.ThreatenedColumns(), 0b0100010u);
  const Board vertical = Played("171717");
  EXPECT_EQ(vertical.WinningColumns(), 0b0000001u);
  EXPECT_EQ(vertical.ThreatenedColumns(), 0b1000000u);
}

TEST(Board, WinningColumnsAreThoseThatWinWhenPlayed) {
  Rng rng(13);
  for (int game = 0; game < 300; ++game) {
    Board board;
    while (!board.IsOver()) {
      unsigned wins = 0;
      for (int column = 0; column < kColumns; ++column) {
        if (!board.IsLegal(column)) continue;
        Board next = board;
        next.Play(column);
        if (next.LastMoveWon()) wins |= 1u << column;
      }
      ASSERT_EQ(board.WinningColumns(), wins);
      board.PlayCell(ChoiceStream(rng).SetBit(board.landing_cells()));
    }
  }
}

TEST(BoardFromMoves, NamesTheBadCharacter) {
  for (const char* moves : {"448", "440", "44x", "44 "}) {
    const absl::Status status = Board::FromMoves(moves).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()),
                AllOf(HasSubstr("character 3"), HasSubstr(absl::StrCat("'", std::string(1, moves[2]), "'")),
                      HasSubstr("1 (left) to 7")));
  }
}

TEST(BoardFromMoves, NamesTheMoveIntoAFullColumn) {
  const absl::Status status = Board::FromMoves("44444442").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("character 7"), HasSubstr("'4'"), HasSubstr("full")));
}

TEST(BoardFromMoves, NamesTheMoveAfterTheEnd) {
  const absl::Status status = Board::FromMoves("12121213").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("character 8"), HasSubstr("'3'"), HasSubstr("won by move 7")));
}

TEST(WriteObservation, PutsTheSideToMoveInTheFirstPlaneRowByRowFromTheBottom) {
  std::array<float, kObservationSize> observation;
  std::array<float, kColumns> mask;
  observation.fill(-7);
  mask.fill(-7);
  WriteObservation(Played("447"), absl::MakeSpan(observation), absl::MakeSpan(mask));
  std::array<float, kObservationSize> expected = {};
  expected[7 * 1 + 3] = 1;       // own stone: column 4, second row
  expected[42 + 7 * 0 + 3] = 1;  // the other's: column 4 and column 7, bottom row
  expected[42 + 7 * 0 + 6] = 1;
  EXPECT_EQ(observation, expected);
  EXPECT_THAT(mask, ::testing::Each(1.0f));
}

TEST(WriteObservation, MasksFullColumns) {
  std::array<float, kObservationSize> observation;
  std::array<float, kColumns> mask;
  WriteObservation(Played("222222"), absl::MakeSpan(observation), absl::MakeSpan(mask));
  EXPECT_THAT(mask, ::testing::ElementsAre(1, 0, 1, 1, 1, 1, 1));
}

}  // namespace
}  // namespace dbr::connect4
