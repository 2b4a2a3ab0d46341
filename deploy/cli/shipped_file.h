// Files that come with the programs: configs, grids and policies.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// The path of the file that a user names. A name that begins with "deploy/", as in
// "deploy/configs/hopper.textproto", is that file of the working folder or, where there is none, the one that
// came with this program; every other name is given back as it is. NotFound, saying where it was looked for.
absl::StatusOr<std::string> FindShippedFile(absl::string_view name);

// FindShippedFile for a program in the folder `programs`. Each folder F from there upwards is searched for
// F/deploy/... (a source tree around its build folder) and F/share/dbr/... (where dbr is installed).
absl::StatusOr<std::string> FindShippedFile(absl::string_view name, const std::string& programs);

}  // namespace dbr
