#include "deploy/probe_report.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "deploy/terminal.h"

namespace dbr {
namespace {

using connect4::Board;
using connect4::Cell;
using connect4::kColumns;
using connect4::kRows;
using Json = nlohmann::ordered_json;

constexpr const char* kStones[] = {"●", "○"};  // of the first and the second player

// A value as a share of the bar: probabilities as they are, Q from its range [-1, 1].
double Probability(float value) {
  return value;
}
double OfQ(float value) {
  return (value + 1.0) / 2;
}

std::string BarCell(const std::vector<float>& values, int column, bool legal, double (*fraction)(float)) {
  constexpr int kBar = 9;
  constexpr int kWidth = kBar + 8;
  if (values.empty()) return PadRight("–", kWidth);
  if (!legal) return PadRight("full", kWidth);
  return PadRight(absl::StrCat(Bar(fraction(values[column]), kBar), PadLeft(Fixed(values[column], 2), 6)),
                  kWidth);
}

std::string Sparks(const Board& board, const std::vector<float>& values, double (*fraction)(float)) {
  if (values.empty()) return "–";
  std::string text = "│";
  for (int c = 0; c < kColumns; ++c) text += board.IsLegal(c) ? Spark(fraction(values[c])) : "×";
  return text + "│";
}

std::string DrawBoard(const Board& board) {
  const int mover = board.ply() % 2;
  std::string text;
  for (int row = kRows - 1; row >= 0; --row) {
    text += "  ";
    for (int c = 0; c < kColumns; ++c) {
      const bool own = (board.mover() & Cell(c, row)) != 0;
      const bool taken = (board.occupied() & Cell(c, row)) != 0;
      absl::StrAppend(&text, " ", taken ? kStones[own ? mover : 1 - mover] : "·");
    }
    text += "\n";
  }
  return absl::StrCat(text, "   1 2 3 4 5 6 7\n");
}

Json PerColumn(const Board& board, const std::vector<float>& values) {
  if (values.empty()) return nullptr;
  Json list = Json::array();
  for (int c = 0; c < kColumns; ++c) {
    list.push_back(board.IsLegal(c) && std::isfinite(values[c]) ? Json(values[c]) : Json(nullptr));
  }
  return list;
}

Json Share(const std::optional<double>& share) {
  return share.has_value() ? Json(*share) : Json(nullptr);
}

std::string ShareLine(const char* name, const std::optional<double>& share) {
  if (!share.has_value()) return absl::StrFormat("  %-22s none in the file\n", name);
  return absl::StrFormat("  %-22s %s %5.1f%%\n", name, Bar(*share, 20), 100 * *share);
}

}  // namespace

std::string Figure(absl::string_view moves, const ProbedPosition& probed) {
  const Board& board = probed.board;
  const int mover = board.ply() % 2;
  std::string text =
      absl::StrCat(moves.empty() ? "the empty board" : absl::StrCat("after ", moves), ": player ", mover + 1,
                   " (", kStones[mover], ") to move, and the policy plays column ", probed.move + 1, "\n\n",
                   DrawBoard(board), "\n");
  absl::StrAppend(&text, " column  ", PadRight("pi", 17), PadRight("beta+", 17), PadRight("beta-", 17),
                  "Q, from -1 to 1\n");
  for (int c = 0; c < kColumns; ++c) {
    const bool legal = board.IsLegal(c);
    std::string line = absl::StrCat("   ", c + 1, c == probed.move ? " ◀   " : "     ");
    absl::StrAppend(&line, BarCell(probed.pi, c, legal, Probability),
                    BarCell(probed.beta_plus, c, legal, Probability),
                    BarCell(probed.beta_minus, c, legal, Probability), BarCell(probed.q, c, legal, OfQ));
    absl::StrAppend(&text, line.substr(0, line.find_last_not_of(' ') + 1), "\n");
  }
  return text;
}

std::string FigureLine(const ReferencePosition& position, const ProbedPosition& probed) {
  const int column = probed.move + 1;
  const char* verdict = Contains(position.best, column)          ? "✓"
                        : Contains(position.keeps_value, column) ? "~"
                                                                 : "✗";
  std::string best;
  for (const int c : position.best) absl::StrAppend(&best, c);
  return absl::StrCat(PadRight(position.id, 8), PadRight(position.kind, 12), "plays ", column, " ", verdict,
                      "  best ", PadRight(best, 9), "pi ", Sparks(probed.board, probed.pi, Probability),
                      "  beta+ ", Sparks(probed.board, probed.beta_plus, Probability), "  beta- ",
                      Sparks(probed.board, probed.beta_minus, Probability), "  Q ",
                      Sparks(probed.board, probed.q, OfQ));
}

std::string SharesText(const ProbeShares& shares) {
  return absl::StrCat(
      "of ", WithCommas(shares.positions), " positions, the moves that\n",
      ShareLine("answer must_block", shares.must_block), ShareLine("answer must_win", shares.must_win),
      ShareLine("keep a decisive value", shares.keeps_value_decisive), ShareLine("are best", shares.best));
}

Json ToJson(absl::string_view moves, const ProbedPosition& probed) {
  return {{"moves", std::string(moves)},
          {"to_move", probed.board.ply() % 2 + 1},
          {"move", probed.move + 1},
          {"pi", PerColumn(probed.board, probed.pi)},
          {"beta_plus", PerColumn(probed.board, probed.beta_plus)},
          {"beta_minus", PerColumn(probed.board, probed.beta_minus)},
          {"q", PerColumn(probed.board, probed.q)}};
}

Json ToJson(const ProbeShares& shares) {
  return {{"positions", shares.positions},
          {"must_block", Share(shares.must_block)},
          {"must_win", Share(shares.must_win)},
          {"keeps_value_decisive", Share(shares.keeps_value_decisive)},
          {"best", Share(shares.best)}};
}

}  // namespace dbr
