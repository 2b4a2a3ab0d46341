#include "deploy/experiment/board.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

constexpr int kBarCells = 12;

std::string Percent(double fraction) {
  return absl::StrCat(Fixed(100 * fraction, 0), "%");
}

std::string Left(const std::optional<absl::Duration>& left) {
  return left.has_value() ? absl::StrCat(Clock(*left), " left") : "time left not known yet";
}

std::string RowText(const BoardRow& row, int name_width) {
  const CellProgress& progress = row.progress;
  std::string text = absl::StrCat("  ", PadRight(row.cell, name_width), "  ", PadRight(progress.phase, 10));
  if (progress.amount.empty()) return text;
  absl::StrAppend(&text, "  ", Bar(progress.fraction, kBarCells), " ", PadLeft(Percent(progress.fraction), 4),
                  "  ", progress.amount);
  if (!progress.newest.empty()) absl::StrAppend(&text, " · ", progress.newest);
  if (progress.left.has_value() && progress.fraction < 1) absl::StrAppend(&text, " · ", Left(progress.left));
  return text;
}

// For an output that keeps all lines.
std::string OneLine(const BoardState& state) {
  std::vector<std::string> parts;
  for (const BoardRow& row : state.running)
    parts.push_back(absl::StrCat(row.cell, " ", row.progress.phase, " ", Percent(row.progress.fraction)));
  return absl::StrCat(BoardTotals(state), parts.empty() ? "" : "; ", absl::StrJoin(parts, ", "));
}

}  // namespace

std::string BoardTotals(const BoardState& state) {
  std::string text = absl::StrCat(state.done, " of ", state.all, " done · ", state.running.size(),
                                  " running · ", state.waiting, " waiting");
  if (state.failed > 0) absl::StrAppend(&text, " · ", state.failed, " failed");
  if (state.left_alone > 0) absl::StrAppend(&text, " · ", state.left_alone, " left alone");
  return absl::StrCat(text, " · ", Left(state.left));
}

std::vector<std::string> BoardLines(const BoardState& state, int width, int height) {
  int name_width = 0;
  for (const BoardRow& row : state.running) name_width = std::max(name_width, DisplayWidth(row.cell));
  std::vector<std::string> lines = {Truncate(BoardTotals(state), width)};
  const int room = std::max(1, height - 1);
  const int rows = static_cast<int>(state.running.size());
  const int shown = rows <= room ? rows : room - 1;
  for (int i = 0; i < shown; ++i) lines.push_back(Truncate(RowText(state.running[i], name_width), width));
  if (shown < rows) lines.push_back(Truncate(absl::StrCat("  and ", rows - shown, " more"), width));
  return lines;
}

Board::Board(std::FILE* out, absl::Duration every)
    : out_(out), terminal_(IsTerminal(fileno(out))), every_(every) {}

void Board::Update(const BoardState& state, absl::Time now) {
  if (terminal_) {
    // A cell and a line are left free: some terminals wrap or scroll when the last one is written.
    Erase();
    lines_ = BoardLines(state, TerminalWidth(fileno(out_), 80) - 1, TerminalHeight(fileno(out_), 24) - 1);
    Draw();
  } else {
    if (now - last_ < every_) return;
    last_ = now;
    std::fprintf(out_, "%s\n", OneLine(state).c_str());
  }
  std::fflush(out_);
}

void Board::Say(const std::string& text) {
  Erase();
  std::fprintf(out_, "%s\n", text.c_str());
  Draw();
  std::fflush(out_);
}

void Board::End() {
  Erase();
  lines_.clear();
  std::fflush(out_);
}

void Board::Erase() {
  if (!lines_.empty()) std::fprintf(out_, "\033[%zuA\r\033[J", lines_.size());
}

void Board::Draw() {
  for (const std::string& line : lines_) std::fprintf(out_, "%s\n", line.c_str());
}

}  // namespace dbr
