#include "deploy/cli/shipped_file.h"

#include <filesystem>
#include <vector>

#include "absl/strings/str_cat.h"

namespace dbr {

absl::StatusOr<std::string> FindShippedFile(absl::string_view name) {
  const std::filesystem::path relative{std::string(name)};
  std::error_code ignored;
  std::vector<std::filesystem::path> folders = {""};
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", ignored);
  for (std::filesystem::path folder = self.parent_path(); !folder.empty(); folder = folder.parent_path()) {
    folders.push_back(folder);
    if (folder == folder.root_path()) break;
  }
  for (const std::filesystem::path& folder : folders) {
    const std::filesystem::path path = folder / relative;
    if (std::filesystem::is_regular_file(path, ignored)) return path.string();
  }
  return absl::NotFoundError(absl::StrCat("found no ", name, ", neither in the working folder nor above ",
                                          self.parent_path().string()));
}

}  // namespace dbr
