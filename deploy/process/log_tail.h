// Reads the last lines of a process's log.
#pragma once

#include <sys/types.h>

#include <string>

#include "absl/strings/string_view.h"

namespace dbr {

// Returns the last `lines` lines of the file `path` after the offset `start` (bytes), each indented by four
// spaces. Empty where there is nothing to read. Reads the file; blocks for that.
std::string LogTail(const std::string& path, off_t start, int lines = 5);

}  // namespace dbr
