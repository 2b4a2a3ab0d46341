#include "deploy/experiment/status_screen.h"

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

std::string RowText(const StatusRow& row, int name_width) {
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
std::string OneLine(const GridStatus& state) {
  std::vector<std::string> parts;
  for (const StatusRow& row : state.running)
    parts.push_back(absl::StrCat(row.cell, " ", row.progress.phase, " ", Percent(row.progress.fraction)));
  return absl::StrCat(StatusTotals(state), parts.empty() ? "" : "; ", absl::StrJoin(parts, ", "));
}

}  // namespace

std::string StatusTotals(const GridStatus& state) {
  std::string text = absl::StrCat(state.done, " of ", state.all, " done · ", state.running.size(),
                                  " running · ", state.waiting, " waiting");
  if (state.failed > 0) absl::StrAppend(&text, " · ", state.failed, " failed");
  if (state.left_alone > 0) absl::StrAppend(&text, " · ", state.left_alone, " left alone");
  return absl::StrCat(text, " · ", Left(state.left));
}

std::vector<std::string> StatusLines(const GridStatus& state, int width, int height) {
  int name_width = 0;
  for (const StatusRow& row : state.running) name_width = std::max(name_width, DisplayWidth(row.cell));
  std::vector<std::string> lines = {Truncate(StatusTotals(state), width)};
  const int room = std::max(1, height - 1);
  const int rows = static_cast<int>(state.running.size());
  const int shown = rows <= room ? rows : room - 1;
  for (int i = 0; i < shown; ++i) lines.push_back(Truncate(RowText(state.running[i], name_width), width));
  if (shown < rows) lines.push_back(Truncate(absl::StrCat("  and ", rows - shown, " more"), width));
  return lines;
}

StatusScreen::StatusScreen(Output* out, absl::Duration every)
    : out_(out), terminal_(IsTerminal(out->fd())), every_(every) {}

void StatusScreen::Update(const GridStatus& state, absl::Time now) {
  if (out_->behind()) return;  // a newer state will follow
  if (terminal_) {
    // A cell and a line are left free: some terminals wrap or scroll when the last one is written.
    const std::string erase = EraseText();
    lines_ = StatusLines(state, TerminalWidth(out_->fd(), 80) - 1, TerminalHeight(out_->fd(), 24) - 1);
    out_->Write(absl::StrCat(erase, LinesText()));
  } else {
    if (now - last_ < every_) return;
    last_ = now;
    out_->Write(absl::StrCat(OneLine(state), "\n"));
  }
}

void StatusScreen::Say(const std::string& text) {
  out_->Write(absl::StrCat(EraseText(), text, "\n", LinesText()));
}

void StatusScreen::End() {
  out_->Write(EraseText());
  lines_.clear();
}

std::string StatusScreen::EraseText() const {
  return lines_.empty() ? "" : absl::StrCat("\033[", lines_.size(), "A\r\033[J");
}

std::string StatusScreen::LinesText() const {
  return lines_.empty() ? "" : absl::StrCat(absl::StrJoin(lines_, "\n"), "\n");
}

}  // namespace dbr
