// Named arrays of float32 with text metadata in one checksummed file of the safetensors format.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/policy_snapshot.h"

namespace dbr {

// The contents of one file, as plain values. Checkpoints and policy files are both of this kind.
struct TensorFile {
  std::map<std::string, std::vector<float>> tensors;  // by name; each flat, of one dimension
  std::map<std::string, std::string> metadata;        // counters, specs; the writer adds "crc32c" of the data
};

// Writes a file atomically (core/file_io.h). Errors: ResourceExhausted where the disk is full, NotFound,
// PermissionDenied. Blocks.
absl::Status SaveTensors(const TensorFile& file, const std::string& path);

// Reads a file. DataLoss, naming the file and what was expected and found, where it is truncated, its header
// is malformed, an offset lies outside the data, or the checksum differs; NotFound where there is none.
absl::StatusOr<TensorFile> LoadTensors(const std::string& path);

// A policy as a file: one tensor for each network, with the spec and the version in the metadata. Errors are
// those of SaveTensors and LoadTensors; InvalidArgument where the file is no policy's, DataLoss where its
// metadata is damaged.
absl::Status SavePolicy(const PolicySnapshot& snapshot, const std::string& path);
absl::StatusOr<PolicySnapshot> LoadPolicy(const std::string& path);

}  // namespace dbr
