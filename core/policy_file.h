// A policy as the tensors and the metadata of its file, for those who add metadata of their own.
// core/safetensors.h saves and loads whole files.
#pragma once

#include "absl/status/statusor.h"
#include "core/policy_snapshot.h"
#include "core/safetensors.h"

namespace dbr {

// What SavePolicy writes. InvalidArgument where networks share a name, or one is empty or has a comma.
absl::StatusOr<TensorFile> PolicyTensors(const PolicySnapshot& snapshot);

}  // namespace dbr
