#include "envs/connect4/board.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/check.h"

namespace dbr::connect4 {
namespace {

absl::Status BadMove(absl::string_view moves, std::size_t index, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat("moves: character ", index + 1, " of \"", moves, "\" is '",
                                                 moves.substr(index, 1), "': ", why));
}

// Returns the columns that have one of `cells`, as bits.
unsigned ColumnsOf(Cells cells) {
  unsigned columns = 0;
  for (; cells != 0; cells &= cells - 1) columns |= 1u << (std::countr_zero(cells) / kColumnStride);
  return columns;
}

// Sets the floats of `cells` in a plane [kRows x kColumns] to 1.
void MarkCells(Cells cells, float* plane) {
  for (; cells != 0; cells &= cells - 1) {
    const int bit = std::countr_zero(cells);
    plane[bit % kColumnStride * kColumns + bit / kColumnStride] = 1.0f;
  }
}

}  // namespace

absl::StatusOr<Board> Board::FromMoves(absl::string_view moves) {
  Board board;
  for (std::size_t i = 0; i < moves.size(); ++i) {
    const int column = moves[i] - '1';
    if (column < 0 || column >= kColumns) {
      return BadMove(moves, i, "expected a column from 1 (left) to 7 (right)");
    }
    if (board.LastMoveWon()) {
      return BadMove(moves, i,
                     absl::StrCat("the game was already over, won by move ", i, "; remove what follows it"));
    }
    if (!board.IsLegal(column))
      return BadMove(moves, i, "that column is full (6 stones); expected another one");
    board.Play(column);
  }
  return board;
}

unsigned Board::LegalColumns() const {
  return LastMoveWon() ? 0 : ColumnsOf(landing_cells());
}

unsigned Board::ColumnsCompletingFour(Cells stones) const {
  Cells completing = 0;
  for (Cells cells = landing_cells(); cells != 0; cells &= cells - 1) {
    const Cells cell = cells & (~cells + 1);
    if (HasFour(stones | cell)) completing |= cell;
  }
  return ColumnsOf(completing);
}

void WritePlanes(Cells own, Cells other, absl::Span<float> observation) {
  DBR_CHECK(observation.size() == kObservationSize);
  std::fill(observation.begin(), observation.end(), 0.0f);
  MarkCells(own, observation.data());
  MarkCells(other, observation.data() + kCells);
}

void WriteObservation(const Board& board, absl::Span<float> observation, absl::Span<float> mask) {
  DBR_CHECK(mask.size() == kColumns);
  WritePlanes(board.mover(), board.other(), observation);
  const unsigned legal = board.LegalColumns();
  for (int column = 0; column < kColumns; ++column) mask[column] = static_cast<float>(legal >> column & 1);
}

Symmetry MirrorImage() {
  Symmetry mirror;
  for (int i = 0; i < kObservationSize; ++i) {
    const int column = i % kColumns;
    mirror.observation.push_back(i - column + kColumns - 1 - column);
  }
  for (int column = 0; column < kColumns; ++column) mirror.action.push_back(kColumns - 1 - column);
  return mirror;
}

}  // namespace dbr::connect4
