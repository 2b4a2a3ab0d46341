#include "deploy/launch/summary_reader.h"

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/json_text.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

using Json = nlohmann::json;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::uint64_t Count(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
}

double Real(const Json& json, const char* key, double otherwise) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : otherwise;
}

std::string Text(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

// The object or list under `key`; an empty object where there is none.
const Json& Part(const Json& json, const char* key) {
  static const auto* none = new Json(Json::object());
  const auto found = json.find(key);
  return found != json.end() && found->is_structured() ? *found : *none;
}

EvaluationPoint ReadPoint(const Json& json) {
  return {.opponent = Text(json, "opponent"),
          .policy_version = Count(json, "policy_version"),
          .updates = Count(json, "updates"),
          .steps = Count(json, "steps"),
          .episodes = Count(json, "episodes"),
          .score_mean = Real(json, "score_mean", kNaN),
          .score_stderr = Real(json, "score_stderr", kNaN),
          .return_mean = Real(json, "return_mean", kNaN),
          .return_std = Real(json, "return_std", kNaN),
          .iteration = json.contains("iteration") ? std::optional(Count(json, "iteration")) : std::nullopt};
}

std::set<std::uint64_t> ReadSkipped(const Json& json) {
  std::set<std::uint64_t> skipped;
  for (const Json& iteration : Part(json, "skipped_iterations")) {
    if (iteration.is_number_unsigned()) skipped.insert(iteration.get<std::uint64_t>());
  }
  return skipped;
}

EvaluationResult ReadResult(const Json& json) {
  const Json& score = Part(json, "score");
  const Json& returns = Part(json, "return");
  return {.env = Text(json, "env"),
          .opponent = Text(json, "opponent"),
          .episodes = static_cast<int>(Count(json, "episodes")),
          .seed = Count(json, "seed"),
          .score_mean = Real(score, "mean", kNaN),
          .score_stderr = Real(score, "stderr", kNaN),
          .return_mean = Real(returns, "mean", kNaN),
          .return_stderr = Real(returns, "stderr", kNaN),
          .return_std = Real(returns, "std", kNaN),
          .return_min = Real(returns, "min", kNaN),
          .return_max = Real(returns, "max", kNaN),
          .length_mean = Real(Part(json, "steps"), "mean", kNaN)};
}

SeedBufferSummary ReadSeedBuffer(const Json& json) {
  const Json& returns = Part(json, "return");
  return {.path = Text(json, "path"),
          .rows = Count(json, "rows"),
          .bad_rows = Count(json, "bad_rows"),
          .episodes = Count(json, "episodes"),
          .return_mean = Real(returns, "mean", kNaN),
          .return_std = Real(returns, "std", kNaN),
          .return_min = Real(returns, "min", kNaN),
          .return_max = Real(returns, "max", kNaN),
          .rows_per_second = Real(json, "rows_per_second", kNaN),
          .actions_outside = Count(json, "actions_outside")};
}

// Empty where the text is no object or does not say it.
std::optional<RunEnding> ReadEnding(const Json& json) {
  if (!json.is_object() || !json.contains("ended") || !json["ended"].is_string()) return std::nullopt;
  return ParseRunEnding(json["ended"].get<std::string>());
}

std::string FoundInPlaceOfEnding(const Json& json) {
  const bool says_something = json.is_object() && json.contains("ended");
  return says_something
             ? absl::StrCat("found ", json["ended"].dump(-1, ' ', false, Json::error_handler_t::replace))
             : "found none";
}

absl::Status Damaged(const RunFolder& folder, absl::string_view found) {
  return absl::DataLossError(absl::StrCat(
      folder.summary(), " is damaged: expected a JSON object that says how the run 'ended', ", found,
      ". Restore the file, or remove it: the run then counts its seconds, restarts and evaluations from "
      "nothing."));
}

void ReadCounters(const Json& json, RunSummary* summary) {
  summary->wall_s = Real(json, "wall_s", 0);
  summary->training_s = Real(json, "training_s", 0);
  summary->launches = Count(json, "launches");
  summary->games = Count(json, "games");
  summary->transitions = Count(json, "transitions");
  summary->updates = Count(json, "updates");
  summary->policy_version = Count(json, "policy_version");
  summary->restarts = Count(json, "restarts");
  summary->missed_evaluations = Count(json, "missed_evaluations");
}

}  // namespace

absl::StatusOr<RunSummary> LoadSummary(const RunFolder& folder) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(folder.summary()));
  const absl::StatusOr<Json> parsed = ParseJson(text);
  if (!parsed.ok()) return Damaged(folder, absl::StrCat("found ", parsed.status().message()));
  const Json& json = *parsed;
  const std::optional<RunEnding> ended = ReadEnding(json);
  if (!ended.has_value()) return Damaged(folder, FoundInPlaceOfEnding(json));
  RunSummary summary;
  summary.ended = *ended;
  summary.env = Text(json, "env");
  summary.algorithm = Text(json, "algorithm");
  summary.seed = Count(json, "seed");
  summary.config = Text(json, "config");
  summary.commit = Text(json, "commit");
  summary.matrix_products = Text(json, "matrix_products");
  summary.failure = Text(json, "failure");
  ReadCounters(json, &summary);
  if (const Json& seed_buffer = Part(json, "seed_buffer"); !seed_buffer.empty())
    summary.seed_buffer = ReadSeedBuffer(seed_buffer);
  summary.offline_updates = Count(json, "offline_updates");
  std::vector<EvaluationPoint> points;
  for (const Json& point : Part(json, "evaluations")) {
    if (point.is_object()) points.push_back(ReadPoint(point));
  }
  summary.curve = EvaluationCurve(std::move(points), ReadSkipped(json));
  summary.final_policy = Text(json, "policy");
  for (const Json& result : Part(json, "final")) {
    if (result.is_object()) summary.final_results.push_back(ReadResult(result));
  }
  return summary;
}

RunSummary ReadSummary(const RunFolder& folder) {
  absl::StatusOr<RunSummary> earlier = LoadSummary(folder);
  RunSummary summary;
  if (earlier.ok()) summary = *std::move(earlier);
  summary.seed_buffer = SeedBufferSummary();
  return summary;
}

}  // namespace dbr
