#include "deploy/launch/result_tables.h"

#include <cmath>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "deploy/terminal/terminal.h"
#include "envs/registry/registry.h"

namespace dbr {
namespace {

constexpr int kPublishedWidth = 17;

std::string PublishedHeader(const std::vector<PublishedColumn>& columns) {
  std::string header = " │";
  const char* whose = "paper: ";
  for (const PublishedColumn& column : columns) {
    absl::StrAppend(&header, PadLeft(absl::StrCat(whose, column.label), kPublishedWidth));
    whose = "";
  }
  return header;
}

std::string PublishedCells(const std::vector<PublishedColumn>& columns, absl::string_view opponent) {
  std::string cells = " │";
  for (const PublishedColumn& column : columns) {
    std::string cell = "–";
    for (const PublishedScore& score : column.scores) {
      if (score.opponent == opponent) cell = absl::StrCat(Fixed(score.mean, 3), " ± ", Fixed(score.std, 3));
    }
    absl::StrAppend(&cells, PadLeft(cell, kPublishedWidth));
  }
  return cells;
}

// What stands below a table of scores.
std::string ScoreNote(const EnvPresentation& presentation) {
  std::vector<std::string> sentences;
  if (!presentation.scoring.empty()) sentences.push_back(presentation.scoring);
  if (!presentation.published.empty()) sentences.push_back("The paper's ± is the standard deviation.");
  return sentences.empty() ? "" : absl::StrCat(" ", absl::StrJoin(sentences, " "), "\n");
}

// Episodes against opponents: scores, with published ones beside them.
std::string ScoreTable(absl::Span<const EvaluationResult> results) {
  const EnvPresentation& presentation = PresentationOf(results[0].env);
  const std::vector<PublishedColumn>& published = presentation.published;
  std::string table =
      absl::StrCat(PadRight(" opponent", 12), PadLeft(presentation.episodes, 8), PadLeft("score ± s.e.", 18),
                   published.empty() ? "" : PublishedHeader(published), "\n");
  for (const EvaluationResult& result : results) {
    const std::string cell = absl::StrCat(Fixed(result.score_mean, 3), " ± ", Fixed(result.score_stderr, 3));
    absl::StrAppend(&table, PadRight(absl::StrCat(" ", result.opponent), 12),
                    PadLeft(WithCommas(result.episodes), 8), PadLeft(cell, 18),
                    published.empty() ? "" : PublishedCells(published, result.opponent), "\n");
  }
  return absl::StrCat(table, ScoreNote(presentation));
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
