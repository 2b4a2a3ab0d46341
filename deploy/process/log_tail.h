// The last words of a process.
#pragma once

#include <sys/types.h>

#include <string>

#include "absl/strings/string_view.h"

namespace dbr {

// The last `lines` lines of `path` behind `start`, each indented by four spaces; empty where there is nothing
// to read.
std::string LogTail(const std::string& path, off_t start, int lines = 5);

}  // namespace dbr
