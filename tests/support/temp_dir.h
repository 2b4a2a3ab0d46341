// A temporary folder for one test.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "core/check.h"

namespace dbr {

// The constructor makes it empty, and the destructor removes it with its contents. Its path is short enough
// for a unix socket.
class TempDir {
 public:
  TempDir() : path_(testing::TempDir() + "dbr-XXXXXX") { DBR_CHECK(mkdtemp(path_.data()) != nullptr); }
  ~TempDir() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace dbr
