// Reads the JSON files of the reference data.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/reference_dir.h"

namespace dbr {

// A file and its JSON. `json` is not an object where the file is not JSON.
struct ReferenceFile {
  std::string name;
  nlohmann::json json;
};

// Returns every file "PREFIX*.json" of `folder` within the reference data, sorted by name.
inline std::vector<ReferenceFile> ReferenceFiles(const std::string& folder, const std::string& prefix) {
  std::vector<ReferenceFile> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(ReferenceDir() / folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(prefix, 0) != 0 || entry.path().extension() != ".json") continue;
    std::ifstream stream(entry.path());
    files.push_back({name, nlohmann::json::parse(stream, nullptr, /*allow_exceptions=*/false)});
  }
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return files;
}

}  // namespace dbr
