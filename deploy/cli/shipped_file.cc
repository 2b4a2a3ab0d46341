#include "deploy/cli/shipped_file.h"

#include <filesystem>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"

namespace dbr {

absl::StatusOr<std::string> FindShippedFile(absl::string_view name) {
  ASSIGN_OR_RETURN(const std::string programs, ProgramsFolder());
  return FindShippedFile(name, programs);
}

absl::StatusOr<std::string> FindShippedFile(absl::string_view name, const std::string& programs) {
  const std::string in_source(name);
  std::error_code ignored;
  if (!absl::StartsWith(name, "deploy/") || std::filesystem::exists(in_source, ignored)) return in_source;
  const std::string installed = absl::StrCat("share/dbr/", absl::StripPrefix(name, "deploy/"));
  for (std::filesystem::path folder = programs;; folder = folder.parent_path()) {
    for (const std::filesystem::path& path : {folder / in_source, folder / installed}) {
      if (std::filesystem::is_regular_file(path, ignored)) return path.string();
    }
    if (!folder.has_relative_path()) break;
  }
  return absl::NotFoundError(absl::StrCat(
      "found no ", name, " in the working folder ", std::filesystem::current_path(ignored).string(),
      ", and neither it nor ", installed, " in ", programs,
      " or a folder above. Check the name, or give the path of a file of your own"));
}

}  // namespace dbr
