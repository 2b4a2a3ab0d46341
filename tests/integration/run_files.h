// Reads a run's files and its replay server, for tests.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "core/run_folder.h"
#include "tests/integration/dbr_process.h"

namespace dbr {

inline std::string SmallConfig() {
  return absl::StrCat(DBR_SOURCE_DIR, "/tests/integration/small.textproto");
}

inline std::string Contents(const std::string& path) {
  return ReadFile(path).value_or("");
}

inline nlohmann::json Summary(const RunFolder& run) {
  return nlohmann::json::parse(Contents(run.summary()), nullptr, /*allow_exceptions=*/false);
}

// Returns the output of `dbr stats --json`, or null where the server does not answer.
inline nlohmann::json Stats(const RunFolder& run) {
  const auto [status, output] = RunProgram("dbr", {"stats", "--replay", run.root, "--json"});
  return status == 0 ? nlohmann::json::parse(output, nullptr, /*allow_exceptions=*/false) : nlohmann::json();
}

// Returns a counter of Stats, or 0 where the server does not answer.
inline std::uint64_t Counter(const RunFolder& run, const char* name) {
  const nlohmann::json stats = Stats(run);
  return stats.is_object() ? stats.value(name, std::uint64_t{0}) : 0;
}

}  // namespace dbr
