// How a grid of runs is going, on a terminal or as lines of a log.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "deploy/experiment/progress.h"
#include "deploy/terminal/output.h"

namespace dbr {

// A running cell.
struct StatusRow {
  std::string cell;  // its name
  CellProgress progress;
};

// What is told of a grid. The counts are of cells.
struct GridStatus {
  std::vector<StatusRow> running;
  int all = 0, done = 0, waiting = 0, failed = 0;
  int left_alone = 0;                  // they hold a run of another config, or another launch uses them
  std::optional<absl::Duration> left;  // until all are done; empty: not known yet
};

// "12 of 45 done · 2 running · 31 waiting · 3:12:40 left", with the failed and the left-alone ones where
// there are some.
std::string StatusTotals(const GridStatus& state);

// The totals, and a line for each running cell: name, phase, how far of how much, newest evaluation, time
// left. At most `width` cells wide, and `height` lines, the last of which then says how many more there are.
std::vector<std::string> StatusLines(const GridStatus& state, int width, int height);

// Keeps the status in place at the bottom of a terminal; where the output is none, writes the totals and how
// far each running cell is as one line now and then. One thread. The output must outlive it.
class StatusScreen {
 public:
  // `every`: how often at most a line is written where `out` is no terminal.
  StatusScreen(Output* out, absl::Duration every);

  void Update(const GridStatus& state, absl::Time now);
  // Writes lines of their own above the status.
  void Say(const std::string& text);
  // Takes the status off the terminal.
  void End();

 private:
  std::string EraseText() const;
  std::string LinesText() const;

  Output* const out_;
  const bool terminal_;
  const absl::Duration every_;
  absl::Time last_ = absl::InfinitePast();
  std::vector<std::string> lines_;  // that stand at the bottom of the terminal
};

}  // namespace dbr
