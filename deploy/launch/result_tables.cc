#include "deploy/launch/result_tables.h"

#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

// Siu, Traish and Xu 2021, table of results, the two Connect-4 rows: mean score and standard deviation.
struct PaperRow {
  const char* opponent;
  const char* dbr;
  const char* bear;
  const char* ddqn;
};
constexpr PaperRow kPaper[] = {{"random", "0.982 ± 0.016", "0.967 ± 0.116", "0.589 ± 0.161"},
                               {"mcts:10", "0.912 ± 0.079", "0.750 ± 0.187", "0.214 ± 0.161"}};

std::string PaperCells(absl::string_view opponent) {
  for (const PaperRow& row : kPaper) {
    if (opponent == row.opponent) {
      return absl::StrCat(PadLeft(row.dbr, 17), PadLeft(row.bear, 17), PadLeft(row.ddqn, 17));
    }
  }
  return absl::StrCat(PadLeft("–", 17), PadLeft("–", 17), PadLeft("–", 17));
}

// Games against opponents: scores, for Connect-4 with the paper's figures beside.
std::string ScoreTable(absl::Span<const EvaluationResult> results) {
  const bool connect4 = results[0].env == "connect4";
  std::string table =
      absl::StrCat(PadRight(" opponent", 12), PadLeft("games", 8), PadLeft("score ± s.e.", 18));
  if (connect4) {
    absl::StrAppend(&table, " │", PadLeft("paper: DBR", 17), PadLeft("BEAR", 17), PadLeft("Double DQN", 17));
  }
  absl::StrAppend(&table, "\n");
  for (const EvaluationResult& result : results) {
    const std::string cell = absl::StrCat(Fixed(result.score_mean, 3), " ± ", Fixed(result.score_stderr, 3));
    absl::StrAppend(&table, PadRight(absl::StrCat(" ", result.opponent), 12),
                    PadLeft(WithCommas(result.episodes), 8), PadLeft(cell, 18));
    if (connect4) absl::StrAppend(&table, " │", PaperCells(result.opponent));
    absl::StrAppend(&table, "\n");
  }
  if (connect4) {
    absl::StrAppend(&table, " A win counts 1, a draw 0.5; each side starts half of the games. ",
                    "The paper's ± is the standard deviation.\n");
  }
  return table;
}

// Environments without a score: the returns of single episodes.
std::string EpisodeTable(absl::Span<const EvaluationResult> results) {
  std::string table =
      absl::StrCat(PadRight(" environment", 14), PadLeft("episodes", 10), PadLeft("return ± s.e.", 20),
                   PadLeft("std", 10), PadLeft("min", 10), PadLeft("max", 10), PadLeft("steps", 9), "\n");
  for (const EvaluationResult& result : results) {
    const std::string mean =
        absl::StrCat(Fixed(result.return_mean, 1), " ± ", Fixed(result.return_stderr, 1));
    absl::StrAppend(&table, PadRight(absl::StrCat(" ", result.env), 14),
                    PadLeft(WithCommas(result.episodes), 10), PadLeft(mean, 20),
                    PadLeft(Fixed(result.return_std, 1), 10), PadLeft(Fixed(result.return_min, 1), 10),
                    PadLeft(Fixed(result.return_max, 1), 10), PadLeft(Fixed(result.length_mean, 1), 9), "\n");
  }
  return table;
}

std::string ReturnLine(const char* when, double value, const std::string& of) {
  return absl::StrCat(PadRight(absl::StrCat(" ", when), 26), PadLeft(Fixed(value, 1), 10), "   ", of, "\n");
}

std::string Describe(const EvaluationPoint& point) {
  return absl::StrCat("update ", WithCommas(point.updates), ", online step ", WithCommas(point.steps), ", ",
                      WithCommas(point.episodes), " episodes");
}

}  // namespace

std::string ResultTable(absl::Span<const EvaluationResult> results) {
  if (results.empty()) return "";
  return std::isfinite(results[0].score_mean) ? ScoreTable(results) : EpisodeTable(results);
}

std::string ReturnsTable(const RunSummary& summary) {
  if (summary.seed_buffer.rows == 0) return "";
  const SeedBufferSummary& seed_buffer = summary.seed_buffer;
  std::string table = absl::StrCat(
      " mean returns\n", ReturnLine("of the seed buffer", seed_buffer.return_mean,
                                    absl::StrCat(WithCommas(seed_buffer.rows), " transitions, ",
                                                 WithCommas(seed_buffer.episodes), " whole episodes")));
  if (const auto point = summary.AfterOffline())
    table += ReturnLine("after the offline phase", point->return_mean, Describe(*point));
  if (const auto point = summary.curve.LowestOnline())
    table += ReturnLine("lowest while online", point->return_mean, Describe(*point));
  for (const EvaluationResult& end : summary.final_results) {
    table += ReturnLine(
        "at the end", end.return_mean,
        absl::StrCat("update ", WithCommas(summary.updates), ", online step ",
                     WithCommas(summary.transitions), ", ", WithCommas(end.episodes), " episodes"));
  }
  return table;
}

}  // namespace dbr
