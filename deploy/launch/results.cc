#include "deploy/launch/results.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"

namespace dbr {
namespace {

using Json = nlohmann::ordered_json;

Json Number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json Estimate(double mean, double standard_error) {
  return {{"mean", Number(mean)}, {"stderr", Number(standard_error)}};
}

Json Spread(double std, double min, double max) {
  return {{"std", Number(std)}, {"min", Number(min)}, {"max", Number(max)}};
}

Json ToJson(const EvaluationPoint& point) {
  Json json = {{"updates", point.updates},
               {"steps", point.steps},
               {"return_mean", Number(point.return_mean)},
               {"return_std", Number(point.return_std)},
               {"episodes", point.episodes},
               {"policy_version", point.policy_version}};
  if (std::isfinite(point.score_mean)) {
    json["score_mean"] = point.score_mean;
    json["score_stderr"] = Number(point.score_stderr);
  }
  if (!point.opponent.empty()) json["opponent"] = point.opponent;
  if (point.iteration.has_value()) json["iteration"] = *point.iteration;
  return json;
}

Json ToJson(const std::optional<EvaluationPoint>& point) {
  return point.has_value() ? ToJson(*point) : Json(nullptr);
}

Json SeedBufferJson(const SeedBufferSummary& seed_buffer) {
  Json returns = {{"mean", Number(seed_buffer.return_mean)}};
  returns.update(Spread(seed_buffer.return_std, seed_buffer.return_min, seed_buffer.return_max));
  return {{"path", seed_buffer.path},
          {"rows", seed_buffer.rows},
          {"bad_rows", seed_buffer.bad_rows},
          {"episodes", seed_buffer.episodes},
          {"return", returns},
          {"rows_per_second", Number(seed_buffer.rows_per_second)},
          {"actions_outside", seed_buffer.actions_outside}};
}

Json ReturnsJson(const RunSummary& summary) {
  Json end = nullptr;
  if (!summary.final_results.empty()) {
    end = ToJson(summary.final_results[0])["return"];
    end["updates"] = summary.updates;
    end["steps"] = summary.transitions;
    end["episodes"] = summary.final_results[0].episodes;
  }
  return {{"seed_buffer", Number(summary.seed_buffer.return_mean)},
          {"after_offline", ToJson(summary.AfterOffline())},
          {"lowest_online", ToJson(summary.curve.LowestOnline())},
          {"end", end}};
}

}  // namespace

Json ToJson(const EvaluationResult& result) {
  Json json = {{"env", result.env},
               {"opponent", result.opponent},
               {"episodes", result.episodes},
               {"seed", result.seed},
               {"score", Estimate(result.score_mean, result.score_stderr)},
               {"return", Estimate(result.return_mean, result.return_stderr)}};
  if (std::isfinite(result.score_mean)) return json;
  json["return"].update(Spread(result.return_std, result.return_min, result.return_max));
  json["steps"] = {{"mean", Number(result.length_mean)}};
  return json;
}

std::string ResultsPath(const RunFolder& folder) {
  return absl::StrCat(folder.root, "/results.txt");
}

absl::Status WriteSummary(const RunSummary& summary, const RunFolder& folder) {
  Json evaluations = Json::array();
  for (const EvaluationPoint& point : summary.curve.points()) evaluations.push_back(ToJson(point));
  Json final_results = Json::array();
  for (const EvaluationResult& result : summary.final_results) final_results.push_back(ToJson(result));
  Json json = {{"env", summary.env},        {"algorithm", summary.algorithm},
               {"seed", summary.seed},      {"config", summary.config},
               {"commit", summary.commit},  {"matrix_products", summary.matrix_products},
               {"run_folder", folder.root}, {"ended", std::string(TextOf(summary.ended))}};
  if (!summary.failure.empty()) json["failure"] = summary.failure;
  if (summary.seed_buffer.rows > 0) {
    json["seed_buffer"] = SeedBufferJson(summary.seed_buffer);
    json["offline_updates"] = summary.offline_updates;
    json["returns"] = ReturnsJson(summary);
  }
  json.update(Json{{"wall_s", summary.wall_s},
                   {"training_s", summary.training_s},
                   {"launches", summary.launches},
                   {"games", summary.games},
                   {"transitions", summary.transitions},
                   {"updates", summary.updates},
                   {"policy_version", summary.policy_version},
                   {"restarts", summary.restarts},
                   {"evaluations", evaluations},
                   {"skipped_iterations", summary.SkippedIterations()},
                   {"policy", summary.final_policy},
                   {"final", final_results}});
  if (summary.missed_evaluations > 0) json["missed_evaluations"] = summary.missed_evaluations;
  // Paths and logs may hold bytes that are not UTF-8.
  const std::string text = json.dump(2, ' ', /*ensure_ascii=*/false, Json::error_handler_t::replace);
  return WriteFileAtomically(folder.summary(), absl::StrCat(text, "\n"));
}

}  // namespace dbr
