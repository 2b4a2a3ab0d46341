#include "replay/dataset/hdf5_trouble.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "core/status_macros.h"
#include "replay/dataset/hdf5_id.h"

namespace dbr {
namespace {

constexpr std::size_t kMaxKeys = 12;
constexpr std::size_t kMaxText = 1024;  // of a name or a path that a file holds

// Every part of the format has a version number of its own; an older library knows a newer part by that.
bool WroteANewerHdf5(absl::string_view reason) {
  return absl::StrContains(reason, "version number");
}

std::string NewerHdf5() {
  return absl::StrCat("expected a file that HDF5 ", H5_VERS_MAJOR, ".", H5_VERS_MINOR,
                      " can read, found one of a newer HDF5");
}

constexpr char kRewrite[] =
    "; rewrite it with that HDF5's h5repack --high=2 IN OUT, or write it in h5py with libver=('earliest', "
    "'v110')";

std::string KeysOf(hid_t file, const std::string& group) {
  std::vector<std::string> keys = GroupKeys(file, group);
  if (keys.empty()) return "without keys";
  const std::size_t more = keys.size() - std::min(keys.size(), kMaxKeys);
  keys.resize(keys.size() - more);
  return absl::StrCat("with the keys ", absl::StrJoin(keys, ", "),
                      more > 0 ? absl::StrCat(" and ", more, " more") : "");
}

// Describes the link `key` where it is one whose target is missing.
std::optional<std::string> DanglingLink(hid_t file, const std::string& key) {
  H5L_info_t link;
  if (H5Lget_info(file, key.c_str(), &link, H5P_DEFAULT) < 0) return std::nullopt;
  if (link.type != H5L_TYPE_SOFT && link.type != H5L_TYPE_EXTERNAL) return std::nullopt;
  if (H5Oexists_by_name(file, key.c_str(), H5P_DEFAULT) > 0) return std::nullopt;
  std::vector<char> value(link.u.val_size + 1);
  if (H5Lget_val(file, key.c_str(), value.data(), link.u.val_size, H5P_DEFAULT) < 0) return std::nullopt;
  if (link.type == H5L_TYPE_SOFT) return absl::StrCat("a link to ", value.data(), ", which is not there");
  const char *other = nullptr, *object = nullptr;
  unsigned flags = 0;
  if (H5Lunpack_elink_val(value.data(), link.u.val_size, &flags, &other, &object) < 0) return std::nullopt;
  return absl::StrCat("a link to ", other, ":", object, ", which is not there");
}

// The same for the groups above `key` too.
std::optional<std::string> DanglingLinkOnTheWay(hid_t file, const std::string& key) {
  for (std::size_t slash = key.find('/'); slash != std::string::npos; slash = key.find('/', slash + 1)) {
    if (auto dangling = DanglingLink(file, key.substr(0, slash)))
      return absl::StrCat("under '", key.substr(0, slash), "' ", *dangling);
  }
  return DanglingLink(file, key);
}

// Files beside this one in which values of an array stand.
std::vector<std::string> OtherFiles(hid_t creation) {
  std::vector<std::string> names;
  std::array<char, kMaxText> name{};
  std::size_t count = 0;
  if (H5Pget_layout(creation) == H5D_VIRTUAL) H5Pget_virtual_count(creation, &count);
  for (std::size_t i = 0; i < count; ++i) {
    if (H5Pget_virtual_filename(creation, i, name.data(), name.size()) > 0) names.emplace_back(name.data());
  }
  const int external = H5Pget_external_count(creation);
  for (int i = 0; i < external; ++i) {
    if (H5Pget_external(creation, static_cast<unsigned>(i), name.size() - 1, name.data(), nullptr, nullptr) >=
        0)
      names.emplace_back(name.data());
  }
  return names;
}

// The library looks beside the file and in the working folder, and gives zeros for what a virtual array takes
// from a file that is missing.
absl::Status CheckOtherFiles(hid_t creation, const std::string& path, const std::string& name) {
  for (const std::string& other : OtherFiles(creation)) {
    std::error_code ignored;
    if (other == "." || std::filesystem::exists(other, ignored) ||
        std::filesystem::exists(std::filesystem::path(path).parent_path() / other, ignored)) {
      continue;
    }
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": expected '", name, "' with all its values, found that some stand in a file ",
                     other, ", which is not there; bring it along, or write the array whole into this file"));
  }
  return absl::OkStatus();
}

absl::Status CheckFilters(hid_t creation, const std::string& path, const std::string& name) {
  for (int i = 0; i < H5Pget_nfilters(creation); ++i) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    std::array<char, 64> text{};
    const H5Z_filter_t filter = H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values, nullptr,
                                               text.size(), text.data(), &config);
    if (filter < 0 || H5Zfilter_avail(filter) > 0) continue;
    text.back() = '\0';
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": expected '", name,
                     "' stored with filters that HDF5 brings along, such as gzip, found filter ", filter,
                     text[0] == '\0' ? "" : absl::StrCat(" (", text.data(), ")"),
                     ", for which there is no plug-in; rewrite the file where there is one: h5repack -f "
                     "GZIP=1 IN OUT, or ",
                     "name the plug-in's folder in HDF5_PLUGIN_PATH"));
  }
  return absl::OkStatus();
}

// Whether an array stored in chunks lacks some of them: reading gives zeros in their place.
bool MissesChunks(hid_t array, hid_t creation) {
  if (H5Pget_layout(creation) != H5D_CHUNKED) return false;
  const Hdf5Id space(H5Dget_space(array), H5Sclose);
  std::array<hsize_t, H5S_MAX_RANK> sizes, chunk;
  const int rank = space.ok() ? H5Sget_simple_extent_dims(space.get(), sizes.data(), nullptr) : -1;
  if (rank <= 0 || H5Pget_chunk(creation, rank, chunk.data()) != rank) return false;
  hsize_t expected = 1, found = 0;
  for (int i = 0; i < rank; ++i) expected *= (sizes[i] + chunk[i] - 1) / chunk[i];
  return H5Dget_num_chunks(array, space.get(), &found) >= 0 && found < expected;
}

}  // namespace

absl::Status OpenFailure(const std::string& path) {
  const std::string reason = Hdf5Reason();
  if (absl::StrContains(reason, "already open for")) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": expected a finished HDF5 file, found one that a program has open for writing, ",
                     "or had open when it was killed; wait for it, or, where none runs, mark the file as ",
                     "closed: h5clear -s ", path));
  }
  if (WroteANewerHdf5(reason)) {
    return absl::FailedPreconditionError(absl::StrCat(path, ": ", NewerHdf5(), " (", reason, ")", kRewrite));
  }
  return absl::DataLossError(absl::StrCat(path, ": expected a whole HDF5 file, found a damaged one (", reason,
                                          "); copy or record it again, or wait until it is written"));
}

absl::Status NoArray(hid_t file, const std::string& path, const std::string& key) {
  const std::string reason = Hdf5Reason();
  const std::string expected =
      absl::StrCat(path, ": expected '", key, "' to be an array of numbers, [rows] or [rows, width], found ");
  if (const auto dangling = DanglingLinkOnTheWay(file, key)) {
    return absl::InvalidArgumentError(
        absl::StrCat(expected, *dangling, "; bring the target along, or put the array itself in its place"));
  }
  H5O_info_t object;
  if (H5Oget_info_by_name2(file, key.c_str(), &object, H5O_INFO_BASIC, H5P_DEFAULT) < 0)
    return absl::InvalidArgumentError(absl::StrCat(expected, "nothing that can be opened (", reason, ")"));
  if (object.type == H5O_TYPE_GROUP) {
    return absl::InvalidArgumentError(
        absl::StrCat(expected, "a group ", KeysOf(file, key),
                     "; spaces of dicts or tuples cannot be read: write them as one flat array"));
  }
  if (WroteANewerHdf5(reason)) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": '", key, "': ", NewerHdf5(), " (", reason, ")", kRewrite));
  }
  return absl::InvalidArgumentError(absl::StrCat(expected, "something that is no array (", reason, ")"));
}

absl::Status NoGroup(hid_t file, const std::string& path, const std::string& key) {
  const std::string reason = Hdf5Reason();
  const std::optional<std::string> dangling = DanglingLink(file, key);
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": expected '", key, "' to be a group, found ",
                   dangling.has_value() ? *dangling : absl::StrCat("something else (", reason, ")")));
}

absl::Status CheckStorage(hid_t array, const std::string& path, const std::string& name) {
  const Hdf5Id creation(H5Dget_create_plist(array), H5Pclose);
  if (!creation.ok()) return absl::OkStatus();  // the reading will tell
  RETURN_IF_ERROR(CheckFilters(creation.get(), path, name));
  RETURN_IF_ERROR(CheckOtherFiles(creation.get(), path, name));
  if (H5Pget_layout(creation.get()) == H5D_VIRTUAL) return absl::OkStatus();
  H5D_space_status_t space = H5D_SPACE_STATUS_ALLOCATED;
  H5Dget_space_status(array, &space);
  const bool empty = space == H5D_SPACE_STATUS_NOT_ALLOCATED;
  if (!empty && !MissesChunks(array, creation.get())) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": expected values in '", name, "', found an array ",
                   empty ? "that nothing was written into" : "of which a part was never written",
                   "; was its writer stopped?"));
}

}  // namespace dbr
