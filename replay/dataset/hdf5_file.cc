#include "replay/dataset/hdf5_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "replay/dataset/hdf5_trouble.h"

namespace dbr {
namespace {

constexpr std::size_t kDefaultCacheBytes = std::size_t{1} << 20;
constexpr std::size_t kMaxCacheBytes = std::size_t{64} << 20;
constexpr std::size_t kCacheSlots = 521;  // the library's default: a prime

// Checks that the system lets us read the file at all; the library's own words for it are of little help. It
// would also wait for ever for whoever writes into a pipe.
absl::Status CheckReadable(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return ErrnoStatus(errno, "cannot read", path);
  const absl::Status regular = CheckRegularFile(fd, path);
  close(fd);
  return regular;
}

// How large the cache of an array's chunks should be: it holds all chunks under one row, twice, so that no
// chunk is decompressed for each stretch anew.
std::size_t CacheBytes(hid_t array, hid_t type, int rank, const hsize_t* extent) {
  const Hdf5Id creation(H5Dget_create_plist(array), H5Pclose);
  hsize_t chunk[2] = {1, 1};
  if (!creation.ok() || H5Pget_layout(creation.get()) != H5D_CHUNKED ||
      H5Pget_chunk(creation.get(), rank, chunk) != rank) {
    return kDefaultCacheBytes;
  }
  std::size_t bytes = chunk[0] * chunk[1] * H5Tget_size(type);
  if (rank == 2 && chunk[1] > 0) bytes *= (extent[1] + chunk[1] - 1) / chunk[1];
  return std::clamp(2 * bytes, kDefaultCacheBytes, kMaxCacheBytes);
}

std::string KindName(hid_t type) {
  switch (H5Tget_class(type)) {
    case H5T_STRING:
      return "texts";
    case H5T_COMPOUND:
      return "records of several values (a compound type)";
    case H5T_VLEN:
      return "rows of different lengths";
    case H5T_ARRAY:
      return "arrays within an array";
    default:
      return "something else";
  }
}

// Bytes of bits are truth values, as PyTables writes them.
bool IsNumber(hid_t type) {
  const H5T_class_t kind = H5Tget_class(type);
  return kind == H5T_FLOAT || kind == H5T_INTEGER || kind == H5T_ENUM ||
         (kind == H5T_BITFIELD && H5Tget_size(type) == 1);
}

// What makes an array unfit to be read as [rows] or [rows, width] of numbers; empty where nothing does, and
// then `extent` is filled.
std::string FindUnfit(hid_t space, hid_t type, hsize_t extent[2]) {
  if (!IsNumber(type)) return absl::StrCat("an array of ", KindName(type));
  if (H5Sget_simple_extent_type(space) == H5S_NULL) return "an empty value";
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank == 0) return "a single value";
  if (rank != 1 && rank != 2) return absl::StrCat(rank, " dimensions");
  H5Sget_simple_extent_dims(space, extent, nullptr);
  const bool fits = extent[1] > 0 && extent[1] <= std::numeric_limits<int>::max() / sizeof(double) / 65536;
  return fits ? "" : absl::StrCat("a width of ", extent[1]);
}

}  // namespace

absl::Status Hdf5Column::Read(std::int64_t first, int count, hid_t memory_type, void* values) const {
  SilenceHdf5();
  if (count == 0) return absl::OkStatus();
  const hsize_t start[2] = {static_cast<hsize_t>(first), 0};
  const hsize_t extent[2] = {static_cast<hsize_t>(count), static_cast<hsize_t>(width_)};
  const Hdf5Id space(H5Dget_space(array_.get()), H5Sclose);
  const Hdf5Id memory(H5Screate_simple(rank_, extent, nullptr), H5Sclose);
  if (!space.ok() || !memory.ok() ||
      H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start, nullptr, extent, nullptr) < 0 ||
      H5Dread(array_.get(), memory_type, memory.get(), space.get(), H5P_DEFAULT, values) < 0) {
    return absl::DataLossError(
        absl::StrCat(path_, ": cannot read rows ", first, " to ", first + count - 1, " of '", name_, "' (",
                     Hdf5Reason(), "); the file is damaged or was cut short: copy or record it again"));
  }
  return absl::OkStatus();
}

absl::Status Hdf5Column::ReadFloats(std::int64_t first, int count, float* values) const {
  if (!byte_type_.ok() || H5Tget_class(byte_type_.get()) != H5T_BITFIELD)
    return Read(first, count, H5T_NATIVE_FLOAT, values);
  // The library has no conversion of bits to numbers.
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(count) * static_cast<std::size_t>(width_));
  RETURN_IF_ERROR(Read(first, count, byte_type_.get(), bytes.data()));
  std::copy(bytes.begin(), bytes.end(), values);
  return absl::OkStatus();
}

absl::Status Hdf5Column::ReadFlags(std::int64_t first, int count, std::uint8_t* flags) const {
  if (byte_type_.ok()) {
    RETURN_IF_ERROR(Read(first, count, byte_type_.get(), flags));
    for (int i = 0; i < count; ++i) flags[i] = std::min(flags[i], kNoFlag);
    return absl::OkStatus();
  }
  std::vector<double> values(static_cast<std::size_t>(count));  // float would round 1e-50 to 0
  RETURN_IF_ERROR(Read(first, count, H5T_NATIVE_DOUBLE, values.data()));
  for (int i = 0; i < count; ++i) flags[i] = values[i] == 0 ? 0 : values[i] == 1 ? 1 : kNoFlag;
  return absl::OkStatus();
}

absl::StatusOr<Hdf5File> Hdf5File::Open(const std::string& path) {
  SilenceHdf5();
  RETURN_IF_ERROR(CheckReadable(path));
  const Hdf5Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // Some shared file systems know no locks, and a reader needs none.
  H5Pset_file_locking(access.get(), /*use_file_locking=*/false, /*ignore_when_disabled=*/true);
  if (H5Fis_hdf5(path.c_str()) <= 0) {
    return absl::DataLossError(absl::StrCat(path, ": expected an HDF5 file, found none (no HDF5 signature); ",
                                            "is it another format, or a download that broke off?"));
  }
  Hdf5File file;
  file.path_ = path;
  file.file_ = Hdf5Id(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose);
  if (!file.file_.ok()) return OpenFailure(path);
  return file;
}

std::optional<std::string> Hdf5File::Text(const std::string& attribute) const {
  SilenceHdf5();
  const Hdf5Id id(H5Aopen(file_.get(), attribute.c_str(), H5P_DEFAULT), H5Aclose);
  if (!id.ok()) return std::nullopt;
  const Hdf5Id type(H5Aget_type(id.get()), H5Tclose);
  const Hdf5Id space(H5Aget_space(id.get()), H5Sclose);
  if (H5Tget_class(type.get()) != H5T_STRING || H5Sget_simple_extent_npoints(space.get()) != 1)
    return std::nullopt;
  if (H5Tis_variable_str(type.get()) <= 0) {
    std::string text(H5Tget_size(type.get()), '\0');
    if (H5Aread(id.get(), type.get(), text.data()) < 0) return std::nullopt;
    return text.substr(0, text.find('\0'));
  }
  char* letters = nullptr;
  if (H5Aread(id.get(), type.get(), &letters) < 0 || letters == nullptr) return std::nullopt;
  std::string text = letters;
  H5free_memory(letters);
  return text;
}

std::optional<std::int64_t> Hdf5File::Number(const std::string& attribute) const {
  SilenceHdf5();
  const Hdf5Id id(H5Aopen(file_.get(), attribute.c_str(), H5P_DEFAULT), H5Aclose);
  if (!id.ok()) return std::nullopt;
  const Hdf5Id type(H5Aget_type(id.get()), H5Tclose);
  const Hdf5Id space(H5Aget_space(id.get()), H5Sclose);
  std::int64_t number = 0;
  if (H5Tget_class(type.get()) != H5T_INTEGER || H5Sget_simple_extent_npoints(space.get()) != 1 ||
      H5Aread(id.get(), H5T_NATIVE_INT64, &number) < 0) {
    return std::nullopt;
  }
  return number;
}

std::vector<std::string> Hdf5File::Keys(const std::string& group) const {
  SilenceHdf5();
  return GroupKeys(file_.get(), group.empty() ? "/" : group);
}

bool Hdf5File::Has(const std::string& key) const {
  SilenceHdf5();
  const std::size_t slash = key.find('/');
  if (slash != std::string::npos && H5Lexists(file_.get(), key.substr(0, slash).c_str(), H5P_DEFAULT) <= 0)
    return false;
  return H5Lexists(file_.get(), key.c_str(), H5P_DEFAULT) > 0;
}

absl::Status Hdf5File::CheckGroup(const std::string& key) const {
  SilenceHdf5();
  const Hdf5Id group(H5Gopen2(file_.get(), key.c_str(), H5P_DEFAULT), H5Gclose);
  return group.ok() ? absl::OkStatus() : NoGroup(file_.get(), path_, key);
}

bool Hdf5File::IsArray(const std::string& key) const {
  SilenceHdf5();
  const Hdf5Id array(H5Dopen2(file_.get(), key.c_str(), H5P_DEFAULT), H5Dclose);
  if (!array.ok()) return false;
  const Hdf5Id space(H5Dget_space(array.get()), H5Sclose);
  return H5Sget_simple_extent_ndims(space.get()) > 0;
}

absl::StatusOr<Hdf5Column> Hdf5File::Column(const std::string& key) const {
  SilenceHdf5();
  Hdf5Column column;
  column.path_ = path_;
  column.name_ = key;
  column.array_ = Hdf5Id(H5Dopen2(file_.get(), key.c_str(), H5P_DEFAULT), H5Dclose);
  if (!column.array_.ok()) return NoArray(file_.get(), path_, key);
  const Hdf5Id space(H5Dget_space(column.array_.get()), H5Sclose);
  const Hdf5Id type(H5Dget_type(column.array_.get()), H5Tclose);
  hsize_t extent[2] = {0, 1};
  if (const std::string found = FindUnfit(space.get(), type.get(), extent); !found.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        path_, ": expected '", key, "' to be an array of numbers, [rows] or [rows, width], found ", found));
  }
  column.rank_ = H5Sget_simple_extent_ndims(space.get());
  column.rows_ = static_cast<std::int64_t>(extent[0]);
  column.width_ = static_cast<int>(extent[1]);
  if (column.rows_ > 0) RETURN_IF_ERROR(CheckStorage(column.array_.get(), path_, key));
  const std::size_t cache = CacheBytes(column.array_.get(), type.get(), column.rank_, extent);
  if (cache > kDefaultCacheBytes) {  // a size that only opening can set
    const Hdf5Id access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
    H5Pset_chunk_cache(access.get(), kCacheSlots, cache, 1);
    column.array_ = Hdf5Id(H5Dopen2(file_.get(), key.c_str(), access.get()), H5Dclose);
    if (!column.array_.ok()) return NoArray(file_.get(), path_, key);
  }
  if (H5Tget_class(type.get()) != H5T_FLOAT && H5Tget_size(type.get()) == 1)
    column.byte_type_ = Hdf5Id(H5Tcopy(type.get()), H5Tclose);
  return column;
}

}  // namespace dbr
