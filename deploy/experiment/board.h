// The table of a grid's progress.
#pragma once

#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "deploy/experiment/progress.h"

namespace dbr {

struct BoardRow {
  std::string cell;
  CellProgress progress;
};

// What the board tells. The counts are of cells.
struct BoardState {
  std::vector<BoardRow> running;
  int all = 0, done = 0, waiting = 0, failed = 0;
  int left_alone = 0;                  // of another config, or in use by another launch
  std::optional<absl::Duration> left;  // until all are done; empty: not known yet
};

// "12 of 45 done · 2 running · 31 waiting · 3:12:40 left", and failed and left-alone ones where there are
// some.
std::string BoardTotals(const BoardState& state);

// The totals, and a line for each running cell: name, phase, how far of how much, newest evaluation, time
// left. At most `width` cells wide, and `height` lines, the last of which then says how many more there are.
std::vector<std::string> BoardLines(const BoardState& state, int width, int height);

// Writes it: in place on a terminal, else the totals and how far each running cell is as one line now and
// then. One thread.
class Board {
 public:
  // `every`: how often at most a line is written where `out` is no terminal.
  Board(std::FILE* out, absl::Duration every);

  void Update(const BoardState& state, absl::Time now);
  // Lines of their own above the board.
  void Say(const std::string& text);
  // Takes the board off the screen.
  void End();

 private:
  void Erase();
  void Draw();

  std::FILE* const out_;
  const bool terminal_;
  const absl::Duration every_;
  absl::Time last_ = absl::InfinitePast();
  std::vector<std::string> lines_;  // that stand at the bottom of the terminal
};

}  // namespace dbr
