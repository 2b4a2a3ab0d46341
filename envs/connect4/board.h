// Connect-4 on bitboards: the rules, and the planes that a learning agent sees.
#pragma once

#include <bit>
#include <cstdint>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "core/symmetry.h"

namespace dbr::connect4 {

inline constexpr int kColumns = 7;
inline constexpr int kRows = 6;
inline constexpr int kCells = kColumns * kRows;
inline constexpr int kObservationSize = 2 * kCells;

// A set of cells. The cell of (column, row), with row 0 at the bottom, is bit 7 * column + row. The seventh
// bit of each column is never set on a board. It prevents lines from the top of one column into the bottom of
// the next.
//
//   bit of each cell:      5 12 19 26 33 40 47   row 5 (top)
//                          4 11 18 25 32 39 46
//                          3 10 17 24 31 38 45
//                          2  9 16 23 30 37 44
//                          1  8 15 22 29 36 43
//                          0  7 14 21 28 35 42   row 0
//               column     0  1  2  3  4  5  6
using Cells = std::uint64_t;

inline constexpr int kColumnStride = kRows + 1;
inline constexpr Cells kBottomRow = 0x0000040810204081u;
inline constexpr Cells kAllCells = kBottomRow * 0x3f;

constexpr Cells Cell(int column, int row) {
  return Cells{1} << (kColumnStride * column + row);
}

// Whether the stones hold four in a line: vertical, horizontal or on one of the two diagonals.
constexpr bool HasFour(Cells stones) {
  const Cells up = stones & (stones >> 1);
  const Cells across = stones & (stones >> kColumnStride);
  const Cells rising = stones & (stones >> (kColumnStride + 1));
  const Cells falling = stones & (stones >> (kColumnStride - 1));
  return ((up & (up >> 2)) | (across & (across >> (2 * kColumnStride))) |
          (rising & (rising >> (2 * (kColumnStride + 1)))) |
          (falling & (falling >> (2 * (kColumnStride - 1))))) != 0;
}

// The cells where the next stone of each column would land. A full column has none.
constexpr Cells LandingCells(Cells occupied) {
  return (occupied + kBottomRow) & kAllCells;
}

// A position: a plain value of 16 bytes. Columns count from 0 at the left. No function checks that a move is
// legal; callers that take moves from outside must call IsLegal first.
class Board {
 public:
  Board() = default;

  // Plays `moves`, columns '1' (left) to '7', from the empty board. The game may end with the last move.
  // Returns InvalidArgument, with the position and the character, for another character, a full column, or a
  // move after the end.
  static absl::StatusOr<Board> FromMoves(absl::string_view moves);

  // Requires IsLegal(column).
  void Play(int column) { PlayCell(landing_cells() & (Cells{0x3f} << (kColumnStride * column))); }
  // Requires one of landing_cells().
  void PlayCell(Cells cell) {
    mover_ ^= occupied_;
    occupied_ |= cell;
  }

  // Whether a stone may be put into `column`: it is a column of the board and not full, and the game has not
  // ended.
  bool IsLegal(int column) const {
    return column >= 0 && column < kColumns && !IsOver() && (occupied_ & Cell(column, kRows - 1)) == 0;
  }
  // Bit c is set where IsLegal(c). No bit is set once the game is over.
  unsigned LegalColumns() const;

  // Bit c is set where column c completes four. WinningColumns: columns in which the side to move wins at
  // once. ThreatenedColumns: columns in which the other side would win if it were its turn, and which the
  // side to move must block. Both require a game that is not over.
  unsigned WinningColumns() const { return ColumnsCompletingFour(mover_); }
  unsigned ThreatenedColumns() const { return ColumnsCompletingFour(other()); }

  bool LastMoveWon() const { return HasFour(other()); }
  bool IsFull() const { return occupied_ == kAllCells; }
  bool IsOver() const { return IsFull() || LastMoveWon(); }
  int ply() const { return std::popcount(occupied_); }

  Cells occupied() const { return occupied_; }
  Cells mover() const { return mover_; }              // stones of the side to move
  Cells other() const { return mover_ ^ occupied_; }  // stones of the side that moved last
  Cells landing_cells() const { return LandingCells(occupied_); }

  bool operator==(const Board&) const = default;

 private:
  unsigned ColumnsCompletingFour(Cells stones) const;

  Cells mover_ = 0;
  Cells occupied_ = 0;
};

// Writes two planes of 6 rows x 7 columns: plane 0 has the cells of `own`, plane 1 those of `other`. The
// float of (plane, row, column) has the index 42 * plane + 7 * row + column. Row 0 is the bottom row of the
// board.
void WritePlanes(Cells own, Cells other, absl::Span<float> observation);

// Writes what the side to move sees: its own stones in plane 0, the other side's in plane 1, and the mask
// [kColumns] with 1 for each legal column and 0 elsewhere.
void WriteObservation(const Board& board, absl::Span<float> observation, absl::Span<float> mask);

// The board in a mirror: columns 0 to 6 become 6 to 0, in both planes, in the mask and as actions.
Symmetry MirrorImage();

}  // namespace dbr::connect4
