#include "core/safetensors.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/crc32c.h"
#include "core/file_io.h"
#include "core/json_text.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

using Json = nlohmann::json;

static_assert(std::endian::native == std::endian::little, "the file's floats are little-endian");

constexpr char kMetadata[] = "__metadata__";
// Two checksums in the metadata: one of the data bytes, and one of the header without this second key (its
// JSON in nlohmann's compact form, keys sorted), so that a damaged counter is found as a damaged weight is.
constexpr char kDataCrc[] = "crc32c";
constexpr char kHeaderCrc[] = "crc32c_header";
constexpr std::size_t kPrefixBytes = 8;

std::string HexCrc(std::uint32_t crc) {
  return absl::StrFormat("%08x", crc);
}

std::string HeaderCrc(const Json& header) {
  const std::string text = header.dump(-1, ' ', false, Json::error_handler_t::replace);
  return HexCrc(Crc32c(text.data(), text.size()));
}

absl::Status Damaged(const std::string& path, absl::string_view expected, absl::string_view found) {
  return absl::DataLossError(absl::StrCat(path,
                                          " is damaged or not a safetensors file of this program: expected ",
                                          expected, ", found ", found, ". Use another copy."));
}

// Where one tensor lies in the data part, in bytes.
struct Extent {
  std::string name;
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
};

bool IsPairOfCounts(const Json& value) {
  return value.is_array() && value.size() == 2 && value[0].is_number_unsigned() &&
         value[1].is_number_unsigned();
}

absl::StatusOr<Extent> ReadExtent(const std::string& name, const Json& entry, std::uint64_t data_bytes,
                                  const std::string& path) {
  const std::string what = absl::StrCat("tensor '", name, "' ");
  if (!entry.is_object() || !entry.contains("dtype") || !entry.contains("shape") ||
      !entry.contains("data_offsets")) {
    return Damaged(path, what + "with dtype, shape and data_offsets", "an entry without them");
  }
  const Json& dtype = entry["dtype"];
  if (dtype != "F32")
    return Damaged(path, what + "of dtype F32", dtype.dump(-1, ' ', true, Json::error_handler_t::replace));
  const Json& shape = entry["shape"];
  if (!shape.is_array() || shape.size() != 1 || !shape[0].is_number_unsigned()) {
    return Damaged(path, what + "of one dimension", "another shape");
  }
  const Json& offsets = entry["data_offsets"];
  if (!IsPairOfCounts(offsets)) return Damaged(path, what + "with two data_offsets", "something else");
  const Extent extent{name, offsets[0].get<std::uint64_t>(), offsets[1].get<std::uint64_t>()};
  const auto found = absl::StrCat("offsets ", extent.begin, " to ", extent.end);
  if (extent.begin > extent.end || extent.end > data_bytes) {
    return Damaged(path, absl::StrCat(what, "within ", data_bytes, " bytes of data"), found);
  }
  if (extent.begin % sizeof(float) != 0) return Damaged(path, what + "at a multiple of 4 bytes", found);
  // The length is within the file's, so that comparing counts of floats cannot overflow.
  const std::uint64_t bytes = extent.end - extent.begin, count = shape[0].get<std::uint64_t>();
  if (bytes % sizeof(float) != 0 || bytes / sizeof(float) != count) {
    return Damaged(path, absl::StrCat(what, "of ", count, " floats"), found);
  }
  return extent;
}

// All tensors' extents in the order of the data, which they fill without a gap or an overlap.
absl::StatusOr<std::vector<Extent>> ReadExtents(const Json& header, std::uint64_t data_bytes,
                                                const std::string& path) {
  std::vector<Extent> extents;
  for (const auto& [name, entry] : header.items()) {
    if (name == kMetadata) continue;
    ASSIGN_OR_RETURN(Extent extent, ReadExtent(name, entry, data_bytes, path));
    extents.push_back(std::move(extent));
  }
  std::sort(extents.begin(), extents.end(), [](const Extent& a, const Extent& b) {
    return std::pair(a.begin, a.end) < std::pair(b.begin, b.end);
  });
  std::uint64_t end = 0;
  for (const Extent& extent : extents) {
    if (extent.begin != end) {
      return Damaged(path, absl::StrCat("tensor '", extent.name, "' at offset ", end),
                     absl::StrCat(extent.begin));
    }
    end = extent.end;
  }
  if (end != data_bytes) return Damaged(path, absl::StrCat(end, " bytes of data"), absl::StrCat(data_bytes));
  return extents;
}

absl::Status ReadMetadata(const Json& header, const std::string& path,
                          std::map<std::string, std::string>* metadata) {
  const auto found = header.find(kMetadata);
  if (found == header.end() || !found->is_object())
    return Damaged(path, "a header with __metadata__", "none");
  for (const auto& [key, value] : found->items()) {
    if (!value.is_string())
      return Damaged(path, absl::StrCat("text as metadata '", key, "'"), value.type_name());
    (*metadata)[key] = value.get<std::string>();
  }
  return absl::OkStatus();
}

// Compares with the checksum of that name, and takes it out of the metadata.
absl::Status TakeChecksum(const char* key, const std::string& computed, const std::string& path,
                          std::map<std::string, std::string>* metadata) {
  const auto stored = metadata->extract(key);
  if (stored.empty()) return Damaged(path, absl::StrCat("metadata '", key, "'"), "none");
  if (stored.mapped() != computed) return Damaged(path, absl::StrCat(key, " ", stored.mapped()), computed);
  return absl::OkStatus();
}

absl::StatusOr<Json> ParseHeader(const std::string& bytes, const std::string& path,
                                 std::uint64_t* header_bytes) {
  if (bytes.size() < kPrefixBytes) {
    return Damaged(path, "8 bytes of header length", absl::StrCat("a file of ", bytes.size(), " bytes"));
  }
  std::memcpy(header_bytes, bytes.data(), kPrefixBytes);
  if (*header_bytes > bytes.size() - kPrefixBytes) {
    return Damaged(path, absl::StrCat("a header of ", *header_bytes, " bytes"),
                   absl::StrCat(bytes.size() - kPrefixBytes, " bytes after its length"));
  }
  absl::StatusOr<Json> header = ParseJson(absl::string_view(bytes).substr(kPrefixBytes, *header_bytes));
  if (!header.ok()) return Damaged(path, "a JSON object as header", header.status().message());
  if (!header->is_object()) return Damaged(path, "a JSON object as header", "something else");
  return header;
}

}  // namespace

absl::Status SaveTensors(const TensorFile& file, const std::string& path) {
  Json header = Json::object();
  std::string data;
  for (const auto& [name, values] : file.tensors) {
    if (name == kMetadata)
      return absl::InvalidArgumentError(absl::StrCat("a tensor cannot be named ", kMetadata));
    const std::size_t begin = data.size();
    data.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
    header[name] = {{"dtype", "F32"}, {"shape", {values.size()}}, {"data_offsets", {begin, data.size()}}};
  }
  header[kMetadata] = file.metadata;
  header[kMetadata].erase(kHeaderCrc);
  header[kMetadata][kDataCrc] = HexCrc(Crc32c(data.data(), data.size()));
  header[kMetadata][kHeaderCrc] = HeaderCrc(header);
  std::string text = header.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.append((8 - text.size() % 8) % 8, ' ');  // the data starts at a multiple of 8 bytes

  const std::uint64_t header_bytes = text.size();
  std::string bytes(reinterpret_cast<const char*>(&header_bytes), kPrefixBytes);
  bytes.reserve(kPrefixBytes + text.size() + data.size());
  bytes += text;
  bytes += data;
  return WriteFileAtomically(path, bytes);
}

absl::StatusOr<TensorFile> LoadTensors(const std::string& path) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  std::uint64_t header_bytes = 0;
  ASSIGN_OR_RETURN(Json header, ParseHeader(bytes, path, &header_bytes));
  TensorFile file;
  RETURN_IF_ERROR(ReadMetadata(header, path, &file.metadata));
  const char* data = bytes.data() + kPrefixBytes + header_bytes;
  const std::uint64_t data_bytes = bytes.size() - kPrefixBytes - header_bytes;
  ASSIGN_OR_RETURN(const std::vector<Extent> extents, ReadExtents(header, data_bytes, path));
  header[kMetadata].erase(kHeaderCrc);
  RETURN_IF_ERROR(TakeChecksum(kHeaderCrc, HeaderCrc(header), path, &file.metadata));
  RETURN_IF_ERROR(TakeChecksum(kDataCrc, HexCrc(Crc32c(data, data_bytes)), path, &file.metadata));
  for (const Extent& extent : extents) {
    std::vector<float>& values = file.tensors[extent.name];
    values.resize((extent.end - extent.begin) / sizeof(float));
    if (!values.empty()) std::memcpy(values.data(), data + extent.begin, extent.end - extent.begin);
  }
  return file;
}

}  // namespace dbr
