#include "deploy/report/board_figure.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/check.h"
#include "deploy/report/document.h"
#include "envs/connect4/board.h"

namespace dbr::report {
namespace {

using connect4::Board;
using connect4::Cell;
using connect4::kColumns;
using connect4::kRows;

// Sizes in pixels.
constexpr int kStep = 44;  // between cells
constexpr int kBoardLeft = 20, kBoardTop = 64;
constexpr int kBarsLeft = 2 * kBoardLeft + kColumns * kStep + 40;
constexpr int kPanelWidth = 210, kPanelHeight = 100;
constexpr int kPanelGap = 50;
constexpr int kRowStep = kPanelHeight + 78;
constexpr int kBarStep = kPanelWidth / kColumns;
constexpr char kRed[] = "#D55E00", kYellow[] = "#F0E442", kBlue[] = "#0072B2", kGrey[] = "#999999";

std::string Text(double x, double y, const char* anchor, int size, absl::string_view text) {
  return absl::StrFormat("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" font-size=\"%d\">%s</text>\n", x, y,
                         anchor, size, HtmlEscaped(text));
}

std::string Rect(double x, double y, double width, double height, const char* fill) {
  return absl::StrFormat("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\"/>\n", x, y,
                         width, height, fill);
}

std::string GridLine(double x1, double y1, double x2) {
  return absl::StrFormat("<path d=\"M%.1f,%.1f H%.1f\" stroke=\"#CCCCCC\" stroke-width=\"1\"/>\n", x1, y1,
                         x2);
}

// Red's stones are marked R and Yellow's Y, for readers who see no colours.
std::string DrawBoard(const Board& board) {
  std::string svg = Text(kBoardLeft, kBoardTop - 16, "start", 15, "Red to play: column 7 must be blocked");
  svg += Rect(kBoardLeft, kBoardTop, kColumns * kStep, kRows * kStep, "#44546A");
  for (int column = 0; column < kColumns; ++column) {
    const double x = kBoardLeft + (column + 0.5) * kStep;
    for (int row = 0; row < kRows; ++row) {
      const double y = kBoardTop + (kRows - row - 0.5) * kStep;
      const bool red = (board.mover() & Cell(column, row)) != 0;
      const bool yellow = (board.other() & Cell(column, row)) != 0;
      absl::StrAppendFormat(&svg, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"17\" fill=\"%s\"/>\n", x, y,
                            red ? kRed : (yellow ? kYellow : "#ffffff"));
      if (red || yellow) svg += Text(x, y + 5, "middle", 14, red ? "R" : "Y");
    }
    svg += Text(x, kBoardTop + kRows * kStep + 20, "middle", 14, absl::StrCat(column + 1));
  }
  return svg;
}

std::string DrawBars(const Board& board, const BoardAnswer::Distribution& distribution, double left,
                     double top) {
  std::string svg = Text(left, top - 8, "start", 13, distribution.label);
  for (const double level : {0.0, 0.5, 1.0}) {
    const double y = top + (1 - level) * kPanelHeight;
    svg += GridLine(left, y, left + kPanelWidth) + Text(left - 5, y + 4, "end", 11, absl::StrCat(level));
  }
  for (int column = 0; column < kColumns; ++column) {
    const double probability = board.IsLegal(column) ? distribution.probabilities[column] : 0.0;
    const double height = std::clamp(probability, 0.0, 1.0) * kPanelHeight;
    const double x = left + column * kBarStep;
    const bool blocks = (board.ThreatenedColumns() >> column & 1) != 0;
    svg += Rect(x + 5, top + kPanelHeight - height, kBarStep - 10, height, blocks ? kBlue : kGrey);
    svg += Text(x + kBarStep / 2.0, top + kPanelHeight - height - 3, "middle", 10,
                absl::StrFormat("%.2f", probability));
    svg += Text(x + kBarStep / 2.0, top + kPanelHeight + 15, "middle", 12, absl::StrCat(column + 1));
  }
  return svg;
}

}  // namespace

std::string BoardFigure(const std::vector<BoardAnswer>& answers) {
  const absl::StatusOr<Board> board = Board::FromMoves(kBoardMoves);
  DBR_CHECK(board.ok());
  std::size_t panels = 0;
  std::string bars;
  double top = kBoardTop + 20;
  for (const BoardAnswer& answer : answers) {
    panels = std::max(panels, answer.distributions.size());
    const bool right = (board->ThreatenedColumns() >> answer.move & 1) != 0;
    bars += Text(kBarsLeft, top - 30, "start", 15,
                 absl::StrCat(answer.label, ": plays column ", answer.move + 1,
                              right ? ", which blocks" : ", and loses"));
    for (std::size_t i = 0; i < answer.distributions.size(); ++i)
      bars += DrawBars(*board, answer.distributions[i], kBarsLeft + i * (kPanelWidth + kPanelGap), top);
    top += kRowStep;
  }
  const int width = kBarsLeft + static_cast<int>(panels) * (kPanelWidth + kPanelGap);
  const int height = std::max(kBoardTop + kRows * kStep + 40, static_cast<int>(top) - 40);
  return absl::StrCat("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"", width, "\" height=\"", height,
                      "\" viewBox=\"0 0 ", width, " ", height,
                      "\" font-family=\"sans-serif\" fill=\"#222222\">\n",
                      Rect(0, 0, width, height, "#ffffff"), DrawBoard(*board), bars, "</svg>\n");
}

}  // namespace dbr::report
