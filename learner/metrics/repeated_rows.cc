#include "learner/metrics/repeated_rows.h"

#include <cerrno>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/file_io.h"
#include "core/status_macros.h"
#include "learner/metrics/event_file.h"
#include "learner/metrics/tags.h"

namespace dbr {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kBytesAtOnce = 1 << 20;

bool IsRow(const Json& row) {
  return row.is_object() && row.contains("step") && row["step"].is_number_integer() &&
         row.contains("wall_time") && row["wall_time"].is_number();
}

bool HoldsAndWasDropped(const Json& row, std::int64_t step) {
  const auto at = row["step"].get<std::int64_t>();
  return row.contains(tags::kTransitions) ? at >= step : at == step;
}

std::string RecordOf(const Json& row) {
  Scalars scalars;
  for (const auto& [tag, value] : row.items()) {
    if (tag == "step" || tag == "wall_time") continue;
    scalars.emplace_back(tag,
                         value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN());
  }
  return ScalarRecord(row["step"].get<std::int64_t>(), row["wall_time"].get<double>(), scalars);
}

}  // namespace

absl::Status RepeatWhatHolds(const std::string& path, std::int64_t step, AppendFile* events) {
  std::ifstream rows(path);
  if (!rows) return ErrnoStatus(errno, "cannot open", path);
  std::string records;
  for (std::string line; std::getline(rows, line);) {
    const Json row = Json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (!IsRow(row) || !HoldsAndWasDropped(row, step)) continue;
    records += RecordOf(row);
    if (records.size() < kBytesAtOnce) continue;
    RETURN_IF_ERROR(events->Append(records));
    records.clear();
  }
  return events->Append(records);
}

}  // namespace dbr
