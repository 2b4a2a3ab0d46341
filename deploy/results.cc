#include "deploy/results.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/file_io.h"
#include "deploy/terminal.h"

namespace dbr {
namespace {

using Json = nlohmann::ordered_json;

// Siu, Traish and Xu 2021, table of results, the two Connect-4 rows: mean score and standard deviation.
struct PaperRow {
  const char* opponent;
  const char* dbr;
  const char* bear;
  const char* ddqn;
};
constexpr PaperRow kPaper[] = {{"random", "0.982 ± 0.016", "0.967 ± 0.116", "0.589 ± 0.161"},
                               {"mcts:10", "0.912 ± 0.079", "0.750 ± 0.187", "0.214 ± 0.161"}};

Json Number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json Estimate(double mean, double standard_error) {
  return {{"mean", Number(mean)}, {"stderr", Number(standard_error)}};
}

std::string PaperCells(absl::string_view opponent) {
  for (const PaperRow& row : kPaper) {
    if (opponent == row.opponent) {
      return absl::StrCat(PadLeft(row.dbr, 17), PadLeft(row.bear, 17), PadLeft(row.ddqn, 17));
    }
  }
  return absl::StrCat(PadLeft("–", 17), PadLeft("–", 17), PadLeft("–", 17));
}

std::uint64_t Count(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
}

double Seconds(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : 0;
}

}  // namespace

std::string ResultTable(absl::Span<const EvaluationResult> results) {
  const bool connect4 = !results.empty() && results[0].env == "connect4";
  const bool scores = !results.empty() && std::isfinite(results[0].score_mean);
  std::string table = absl::StrCat(PadRight(" opponent", 12), PadLeft("games", 8),
                                   PadLeft(scores ? "score ± s.e." : "return ± s.e.", 18));
  if (connect4) {
    absl::StrAppend(&table, " │", PadLeft("paper: DBR", 17), PadLeft("BEAR", 17), PadLeft("Double DQN", 17));
  }
  absl::StrAppend(&table, "\n");
  for (const EvaluationResult& result : results) {
    const double mean = scores ? result.score_mean : result.return_mean;
    const double error = scores ? result.score_stderr : result.return_stderr;
    const std::string name = result.opponent.empty() ? result.env : result.opponent;
    const std::string cell = absl::StrCat(Fixed(mean, scores ? 3 : 1), " ± ", Fixed(error, scores ? 3 : 1));
    absl::StrAppend(&table, PadRight(absl::StrCat(" ", name), 12), PadLeft(WithCommas(result.episodes), 8),
                    PadLeft(cell, 18));
    if (connect4) absl::StrAppend(&table, " │", PaperCells(result.opponent));
    absl::StrAppend(&table, "\n");
  }
  if (connect4) {
    absl::StrAppend(&table, " A win counts 1, a draw 0.5; each side starts half of the games. ",
                    "The paper's ± is the standard deviation.\n");
  }
  return table;
}

Json ToJson(const EvaluationResult& result) {
  return {{"env", result.env},
          {"opponent", result.opponent},
          {"episodes", result.episodes},
          {"seed", result.seed},
          {"score", Estimate(result.score_mean, result.score_stderr)},
          {"return", Estimate(result.return_mean, result.return_stderr)}};
}

std::string ResultsPath(const RunFolder& folder) {
  return absl::StrCat(folder.root, "/results.txt");
}

void RunSummary::Update(const RunSample& sample) {
  if (sample.replay.has_value()) {
    games = sample.replay->episodes();
    transitions = sample.replay->inserted();
  }
  if (sample.learner.has_value()) {
    updates = sample.learner->updates();
    policy_version = sample.learner->policy_version();
    if (sample.learner->evaluations_size() > 0) {
      evaluations.assign(sample.learner->evaluations().begin(), sample.learner->evaluations().end());
    }
  }
}

absl::Status WriteSummary(const RunSummary& summary, const RunFolder& folder) {
  Json evaluations = Json::array();
  for (const EvaluationReport& report : summary.evaluations) {
    evaluations.push_back({{"opponent", report.opponent()},
                           {"episodes", report.episodes()},
                           {"policy_version", report.policy_version()},
                           {"updates", report.updates()},
                           {"score", Estimate(report.score_mean(), report.score_stderr())},
                           {"return", Estimate(report.return_mean(), report.return_stderr())}});
  }
  Json final_results = Json::array();
  for (const EvaluationResult& result : summary.final_results) final_results.push_back(ToJson(result));
  Json json = {{"env", summary.env},       {"algorithm", summary.algorithm}, {"seed", summary.seed},
               {"config", summary.config}, {"run_folder", folder.root},      {"ended", summary.ended}};
  if (!summary.failure.empty()) json["failure"] = summary.failure;
  json.update(Json{{"wall_s", summary.wall_s},
                   {"training_s", summary.training_s},
                   {"launches", summary.launches},
                   {"games", summary.games},
                   {"transitions", summary.transitions},
                   {"updates", summary.updates},
                   {"policy_version", summary.policy_version},
                   {"restarts", summary.restarts},
                   {"evaluations", evaluations},
                   {"final", final_results}});
  // Paths and logs may hold bytes that are not UTF-8.
  const std::string text = json.dump(2, ' ', /*ensure_ascii=*/false, Json::error_handler_t::replace);
  return WriteFileAtomically(folder.summary(), absl::StrCat(text, "\n"));
}

RunSummary ReadSummary(const RunFolder& folder) {
  RunSummary summary;
  const absl::StatusOr<std::string> text = ReadFile(folder.summary());
  if (!text.ok()) return summary;
  const Json json = Json::parse(*text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return summary;
  summary.wall_s = Seconds(json, "wall_s");
  summary.training_s = Seconds(json, "training_s");
  summary.launches = Count(json, "launches");
  summary.games = Count(json, "games");
  summary.transitions = Count(json, "transitions");
  summary.updates = Count(json, "updates");
  summary.policy_version = Count(json, "policy_version");
  summary.restarts = Count(json, "restarts");
  return summary;
}

}  // namespace dbr
