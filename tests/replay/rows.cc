#include "tests/replay/rows.h"

#include <cstdlib>
#include <filesystem>

namespace dbr {

TestFolder::TestFolder() {
  // The path is short, for a socket's path has room for 107 characters only.
  std::string name = (std::filesystem::temp_directory_path() / "dbr-XXXXXX").string();
  EXPECT_NE(mkdtemp(name.data()), nullptr) << name;
  path_ = name;
}

TestFolder::~TestFolder() {
  std::error_code error;
  std::filesystem::remove_all(path_, error);
}

}  // namespace dbr
