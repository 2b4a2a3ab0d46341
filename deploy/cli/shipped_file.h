// Files that come with the programs.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// The path of a file named from the top of the project ("deploy/policies/hopper_medium.safetensors"): looked
// for in the working folder, then from the folder of this program upwards. NotFound, naming the file.
absl::StatusOr<std::string> FindShippedFile(absl::string_view name);

}  // namespace dbr
