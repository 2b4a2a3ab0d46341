#include "deploy/probe/probe_report.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

using connect4::Board;
using connect4::Cell;
using connect4::kColumns;
using connect4::kRows;
using Json = nlohmann::ordered_json;

constexpr int kBar = 9;
constexpr int kCellWidth = kBar + 8;
constexpr const char* kStones[] = {"●", "○"};  // of the first and the second player

// A value as a share of the bar: probabilities as they are, Q from its range [-1, 1].
double Probability(float value) {
  return value;
}
double OfQ(float value) {
  return (value + 1.0) / 2;
}

// What is shown of a position, in order.
struct Shown {
  const char* name;
  const std::vector<float>& values;
  double (*fraction)(float);
};
std::vector<Shown> ShownOf(const ProbedPosition& probed) {
  std::vector<Shown> shown = {{"pi", probed.pi, Probability}};
  if (probed.beta.empty()) {
    shown.push_back({"beta+", probed.beta_plus, Probability});
    shown.push_back({"beta-", probed.beta_minus, Probability});
  } else {
    shown.push_back({"beta", probed.beta, Probability});
  }
  shown.push_back({"Q", probed.q, OfQ});
  return shown;
}

std::string BarCell(const std::vector<float>& values, int column, bool legal, double (*fraction)(float)) {
  if (values.empty()) return PadRight("–", kCellWidth);
  if (!legal) return PadRight("full", kCellWidth);
  return PadRight(absl::StrCat(Bar(fraction(values[column]), kBar), PadLeft(Fixed(values[column], 2), 6)),
                  kCellWidth);
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

std::string PositionText(absl::string_view moves, const ProbedPosition& probed) {
  const Board& board = probed.board;
  const int mover = board.ply() % 2;
  std::string text =
      absl::StrCat(moves.empty() ? "the empty board" : absl::StrCat("after ", moves), ": player ", mover + 1,
                   " (", kStones[mover], ") to move, and the policy plays column ", probed.move + 1, "\n\n",
                   DrawBoard(board), "\n");
  const std::vector<Shown> shown = ShownOf(probed);
  absl::StrAppend(&text, " column  ");
  for (const Shown& network : shown) {
    absl::StrAppend(&text,
                    network.fraction == OfQ ? "Q, from -1 to 1\n" : PadRight(network.name, kCellWidth));
  }
  for (int c = 0; c < kColumns; ++c) {
    const bool legal = board.IsLegal(c);
    std::string line = absl::StrCat("   ", c + 1, c == probed.move ? " ◀   " : "     ");
    for (const Shown& network : shown) line += BarCell(network.values, c, legal, network.fraction);
    absl::StrAppend(&text, line.substr(0, line.find_last_not_of(' ') + 1), "\n");
  }
  return text;
}

std::string PositionLine(const ReferencePosition& position, const ProbedPosition& probed) {
  const int column = probed.move + 1;
  const char* verdict = Contains(position.best, column)          ? "✓"
                        : Contains(position.keeps_value, column) ? "~"
                                                                 : "✗";
  std::string best;
  for (const int c : position.best) absl::StrAppend(&best, c);
  std::string line = absl::StrCat(PadRight(position.id, 8), PadRight(position.kind, 12), "plays ", column,
                                  " ", verdict, "  best ", PadRight(best, 9));
  const char* separator = "";
  for (const auto& [name, values, fraction] : ShownOf(probed)) {
    absl::StrAppend(&line, separator, name, " ", Sparks(probed.board, values, fraction));
    separator = "  ";
  }
  return line;
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
          {"beta", PerColumn(probed.board, probed.beta)},
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
