// The reference files of Connect-4: facts of the game that hold for any correct implementation.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/support/reference_dir.h"

namespace dbr::connect4 {

// Reads every KIND*.json in the folder connect4 of the reference data. Fails the test where there is none.
inline std::vector<nlohmann::json> ReadReferenceFiles(const std::string& kind) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(ReferenceDir() / "connect4")) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(kind, 0) == 0 && entry.path().extension() == ".json") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  EXPECT_FALSE(paths.empty()) << "no " << kind << "*.json in " << ReferenceDir() / "connect4";
  std::vector<nlohmann::json> files;
  for (const auto& path : paths) {
    std::ifstream stream(path);
    files.push_back(nlohmann::json::parse(stream, nullptr, /*allow_exceptions=*/false));
    EXPECT_FALSE(files.back().is_discarded()) << path << " is not JSON";
  }
  return files;
}

// Returns the positions of every KIND*.json.
inline std::vector<nlohmann::json> ReadReferencePositions(const std::string& kind) {
  std::vector<nlohmann::json> positions;
  for (const nlohmann::json& file : ReadReferenceFiles(kind)) {
    for (const nlohmann::json& position : file.at("positions")) positions.push_back(position);
  }
  EXPECT_FALSE(positions.empty());
  return positions;
}

}  // namespace dbr::connect4
