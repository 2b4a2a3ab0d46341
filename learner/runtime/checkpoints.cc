#include "learner/runtime/checkpoints.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/status_macros.h"

namespace dbr {

std::vector<std::string> Checkpoints::Newest() const {
  std::vector<std::string> paths;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, error)) {
    if (entry.path().extension() == ".safetensors") paths.push_back(entry.path().string());
  }
  std::sort(paths.rbegin(), paths.rend());  // names are padded numbers
  return paths;
}

absl::Status Checkpoints::Save(std::uint64_t updates, const TensorFile& file) {
  std::error_code error;
  // Not the folder of the run: where that has gone, it was moved, and a new one would split the run.
  std::filesystem::create_directory(folder_, error);
  RETURN_IF_ERROR(SaveTensors(file, absl::StrFormat("%s/%012d.safetensors", folder_, updates)));
  const std::vector<std::string> paths = Newest();
  for (std::size_t i = static_cast<std::size_t>(keep_); i < paths.size(); ++i)
    std::filesystem::remove(paths[i], error);
  return absl::OkStatus();
}

absl::StatusOr<Checkpoints::Loaded> Checkpoints::LoadNewest() const {
  Loaded loaded;
  const std::vector<std::string> paths = Newest();
  if (paths.empty()) return absl::NotFoundError(absl::StrCat("no checkpoint in ", folder_));
  for (const std::string& path : paths) {
    absl::StatusOr<TensorFile> file = LoadTensors(path);
    if (file.ok()) {
      loaded.file = *std::move(file);
      loaded.path = path;
      return loaded;
    }
    loaded.refused.push_back(std::string(file.status().message()));
  }
  return absl::DataLossError(
      absl::StrCat("every checkpoint in ", folder_, " is damaged: ", absl::StrJoin(loaded.refused, "; ")));
}

}  // namespace dbr
