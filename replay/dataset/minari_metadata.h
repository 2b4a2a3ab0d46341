// What a Minari dataset says of itself beside its episodes, and where its file lies.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "replay/dataset/hdf5_file.h"

namespace dbr {

// The HDF5 file that `path` stands for: that of a Minari dataset where it is the dataset's folder (with
// data/main_data.hdf5) or the folder `data` in it, else `path` itself. InvalidArgument for another folder,
// also for a dataset in Minari's arrow format.
absl::StatusOr<std::string> FindDataFile(const std::string& path);

struct MinariMetadata {
  bool is_minari = false;    // it calls itself Minari's
  std::string action_space;  // JSON, as Minari writes spaces; empty: not said
};

// Reads the root's attributes and, for a file main_data.hdf5, the file metadata.json beside it, which newer
// versions of Minari write in place of them. InvalidArgument where metadata.json is no JSON object; errors of
// ReadFile other than NotFound.
absl::StatusOr<MinariMetadata> ReadMinariMetadata(const Hdf5File& file);

}  // namespace dbr
