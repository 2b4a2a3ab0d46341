#include "replay/dataset/minari_metadata.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/json_text.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

constexpr char kMainFile[] = "main_data.hdf5";

std::string TextOf(const nlohmann::json& json, const char* key) {
  const auto entry = json.find(key);
  return entry != json.end() && entry->is_string() ? entry->get<std::string>() : "";
}

}  // namespace

absl::StatusOr<std::string> FindDataFile(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(path, ignored)) return path;
  const std::filesystem::path dataset(path);
  for (const std::filesystem::path& folder : {dataset / "data", dataset}) {
    if (std::filesystem::exists(folder / kMainFile, ignored)) return (folder / kMainFile).string();
  }
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": expected an HDF5 file, or the folder of a Minari dataset in HDF5 format with ",
                   "data/main_data.hdf5, found another folder; name the file"));
}

absl::StatusOr<MinariMetadata> ReadMinariMetadata(const Hdf5File& file) {
  MinariMetadata metadata{.is_minari = file.Text("minari_version").has_value(),
                          .action_space = file.Text("action_space").value_or("")};
  const std::filesystem::path path(file.path());
  if (path.filename() != kMainFile) return metadata;
  const std::string beside = (path.parent_path() / "metadata.json").string();
  const absl::StatusOr<std::string> text = ReadFile(beside);
  if (absl::IsNotFound(text.status())) return metadata;
  RETURN_IF_ERROR(text.status());
  const absl::StatusOr<nlohmann::json> parsed = ParseJson(*text);
  if (!parsed.ok() || !parsed->is_object()) {
    return absl::InvalidArgumentError(absl::StrCat(
        beside, ": expected a JSON object, as Minari writes it, found something else; restore it, ",
        "or take it away"));
  }
  const nlohmann::json& json = *parsed;
  metadata.is_minari = metadata.is_minari || json.contains("minari_version") || json.contains("data_format");
  if (std::string space = TextOf(json, "action_space"); !space.empty())
    metadata.action_space = std::move(space);
  return metadata;
}

}  // namespace dbr
