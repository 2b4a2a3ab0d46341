// Finds the reference data of the tests.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace dbr {

// Returns the environment variable DBR_REFERENCE_DIR, or tests/reference of this source tree.
inline std::filesystem::path ReferenceDir() {
  const char* folder = std::getenv("DBR_REFERENCE_DIR");
  return folder != nullptr && *folder != '\0' ? folder : DBR_DEFAULT_REFERENCE_DIR;
}

}  // namespace dbr
