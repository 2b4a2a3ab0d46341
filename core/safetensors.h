// Named arrays of float32 with text metadata in one checksummed file of the safetensors format.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/policy_snapshot.h"

namespace dbr {

// What one file holds. Checkpoints and policy files are both of this kind.
struct TensorFile {
  std::map<std::string, std::vector<float>> tensors;  // flat
  std::map<std::string, std::string> metadata;        // counters, specs; the writer adds "crc32c" of the data
};

// Writes atomically (core/file_io.h). Errors: ResourceExhausted where the disk is full, NotFound,
// PermissionDenied.
absl::Status SaveTensors(const TensorFile& file, const std::string& path);

// DataLoss, naming the file and what was expected and found, where it is truncated, its header is malformed,
// an offset lies outside the data, or the checksum differs; NotFound where there is none.
absl::StatusOr<TensorFile> LoadTensors(const std::string& path);

// A policy as a file: one tensor for each network, the spec and version in the metadata.
absl::Status SavePolicy(const PolicySnapshot& snapshot, const std::string& path);
absl::StatusOr<PolicySnapshot> LoadPolicy(const std::string& path);

}  // namespace dbr
