// Why the HDF5 library cannot read something, in words for people who have the file and not the library.
#pragma once

#include <hdf5.h>

#include <string>

#include "absl/status/status.h"

namespace dbr {

// The error of a file that H5Fopen has just refused: DataLoss for a damaged or truncated one,
// FailedPrecondition for one that is open for writing or was left so, or that a newer HDF5 wrote.
absl::Status OpenFailure(const std::string& path);

// The error where `key` of the file has just been refused by H5Dopen: InvalidArgument for a group, a link
// whose target is missing or something else that is no array, FailedPrecondition for an array that a newer
// HDF5 wrote.
absl::Status NoArray(hid_t file, const std::string& path, const std::string& key);

// The error where `key` has just been refused by H5Gopen: InvalidArgument, saying what it is.
absl::Status NoGroup(hid_t file, const std::string& path, const std::string& key);

// Whether this library can read all values of an array, as far as that can be told without reading them.
// FailedPrecondition where it was compressed by a filter that is not here; InvalidArgument where parts of it
// stand in files that are missing, or were never written: the library would give zeros for them.
absl::Status CheckStorage(hid_t array, const std::string& path, const std::string& name);

}  // namespace dbr
