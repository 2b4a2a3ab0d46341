// HDF5 files as offline data uses them: arrays of rows, read a stretch at a time.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "replay/dataset/hdf5_id.h"

namespace dbr {

// An array [rows] or [rows, width] of numbers. One thread at a time; keeps its file open.
class Hdf5Column {
 public:
  std::int64_t rows() const { return rows_; }
  int width() const { return width_; }
  const std::string& name() const { return name_; }

  // Reads rows [first, first + count) into `values` [count x width], whatever the numbers' type in the file.
  // DataLoss where the file cannot be read.
  absl::Status ReadFloats(std::int64_t first, int count, float* values) const;
  // Reads rows of a column of width 1 as flags [count]: 0 or 1, and kNoFlag where the number is neither.
  static constexpr std::uint8_t kNoFlag = 2;
  absl::Status ReadFlags(std::int64_t first, int count, std::uint8_t* flags) const;

 private:
  friend class Hdf5File;
  absl::Status Read(std::int64_t first, int count, hid_t memory_type, void* values) const;

  std::string path_;  // of the file
  std::string name_;
  Hdf5Id array_;
  Hdf5Id byte_type_;  // where a row is one byte, its type in the file: read as it is
  std::int64_t rows_ = 0;
  int rank_ = 1;
  int width_ = 1;
};

// A file open for reading. One thread at a time.
class Hdf5File {
 public:
  // NotFound, PermissionDenied, InvalidArgument (no regular file), DataLoss (no HDF5 file, or a truncated
  // one), FailedPrecondition (open for writing elsewhere, or of a newer HDF5), with the path. Never waits for
  // another program.
  static absl::StatusOr<Hdf5File> Open(const std::string& path);

  const std::string& path() const { return path_; }

  // Attributes of the root; empty where it has none of that name and kind.
  std::optional<std::string> Text(const std::string& attribute) const;
  std::optional<std::int64_t> Number(const std::string& attribute) const;

  // Names in a group, "" for the root, sorted; none where it is no group.
  std::vector<std::string> Keys(const std::string& group = "") const;
  // Whether "key" or "group/key" is there.
  bool Has(const std::string& key) const;
  // InvalidArgument where `key` is no group, for example a link whose target is missing, saying so.
  absl::Status CheckGroup(const std::string& key) const;
  // Whether `key` leads to an array of one dimension or more.
  bool IsArray(const std::string& key) const;

  // InvalidArgument where `key` is no array [rows] or [rows, width] of numbers, or not all of its values are
  // there; FailedPrecondition where this HDF5 cannot read it (a missing filter, a newer format).
  absl::StatusOr<Hdf5Column> Column(const std::string& key) const;

 private:
  std::string path_;
  Hdf5Id file_;
};

}  // namespace dbr
