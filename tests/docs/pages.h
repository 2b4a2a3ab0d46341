// Our Markdown pages and sources, by their paths within the tree.
#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace dbr {

inline std::string InTree(const std::string& path) {
  return std::string(DBR_SOURCE_DIR) + "/" + path;
}

inline std::string ReadPage(const std::string& path) {
  std::ifstream stream(InTree(path));
  std::stringstream text;
  text << stream.rdbuf();
  return text.str();
}

// Files below `folder` with one of these endings (".md"), by their paths within the tree.
inline std::vector<std::string> FilesBelow(const std::string& folder,
                                           const std::vector<std::string>& endings) {
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(InTree(folder))) {
    for (const std::string& ending : endings) {
      if (entry.path().extension() == ending)
        paths.push_back(std::filesystem::relative(entry.path(), DBR_SOURCE_DIR).string());
    }
  }
  return paths;
}

// All pages for readers.
inline std::vector<std::string> AllPages() {
  std::vector<std::string> pages = FilesBelow("docs", {".md"});
  pages.insert(pages.end(), {"README.md", "CONTRIBUTING.md", "CHANGELOG.md"});
  return pages;
}

}  // namespace dbr
