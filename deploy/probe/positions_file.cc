#include "deploy/probe/positions_file.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/json_text.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

using Json = nlohmann::json;

absl::Status Wrong(const std::string& where, const char* field, const char* expected) {
  return absl::InvalidArgumentError(absl::StrCat(where, ".", field, ": expected ", expected));
}

absl::Status ReadColumns(const Json& entry, const char* field, const std::string& where,
                         std::vector<int>* columns) {
  const auto found = entry.find(field);
  if (found == entry.end() || !found->is_array()) return Wrong(where, field, "a list of columns 1 to 7");
  for (const Json& column : *found) {
    if (!column.is_number_integer() || column < 1 || column > 7) return Wrong(where, field, "columns 1 to 7");
    columns->push_back(column.get<int>());
  }
  return absl::OkStatus();
}

absl::StatusOr<ReferencePosition> ReadPosition(const Json& entry, const std::string& where) {
  ReferencePosition position;
  if (!entry.is_object()) return absl::InvalidArgumentError(absl::StrCat(where, ": expected an object"));
  const auto moves = entry.find("moves");
  if (moves == entry.end() || !moves->is_string()) return Wrong(where, "moves", "text of columns 1 to 7");
  position.moves = moves->get<std::string>();
  const auto id = entry.find("id");
  position.id = id != entry.end() && id->is_string() ? id->get<std::string>() : position.moves;
  RETURN_IF_ERROR(ReadColumns(entry, "legal", where, &position.legal));
  RETURN_IF_ERROR(ReadColumns(entry, "keeps_value", where, &position.keeps_value));
  RETURN_IF_ERROR(ReadColumns(entry, "best", where, &position.best));
  const auto kind = entry.find("kind");
  if (kind == entry.end() || kind->is_null()) return position;
  if (*kind != "must_block" && *kind != "must_win") return Wrong(where, "kind", "must_block or must_win");
  position.kind = kind->get<std::string>();
  const auto answer = entry.find("answer");
  if (answer == entry.end() || !answer->is_number_integer()) return Wrong(where, "answer", "a column 1 to 7");
  position.answer = answer->get<int>();
  return position;
}

}  // namespace

absl::StatusOr<std::vector<ReferencePosition>> LoadPositions(const std::string& path) {
  ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
  const absl::StatusOr<Json> parsed = ParseJson(text);
  if (!parsed.ok())
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": expected JSON, found ", parsed.status().message()));
  const Json& json = *parsed;
  if (!json.is_object() || !json.contains("positions") || !json["positions"].is_array()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": expected an object with a list 'positions'"));
  }
  std::vector<ReferencePosition> positions;
  for (const Json& entry : json["positions"]) {
    const std::string where = absl::StrCat(path, ": positions[", positions.size(), "]");
    ASSIGN_OR_RETURN(ReferencePosition position, ReadPosition(entry, where));
    positions.push_back(std::move(position));
  }
  if (positions.empty())
    return absl::InvalidArgumentError(absl::StrCat(path, ": expected positions, found none"));
  return positions;
}

}  // namespace dbr
