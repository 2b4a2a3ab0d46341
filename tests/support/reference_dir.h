// Where the reference data of the tests lies.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace dbr {

// The environment variable DBR_REFERENCE_DIR, or tests/reference of this tree.
inline std::filesystem::path ReferenceDir() {
  const char* folder = std::getenv("DBR_REFERENCE_DIR");
  return folder != nullptr && *folder != '\0' ? folder : DBR_DEFAULT_REFERENCE_DIR;
}

}  // namespace dbr
