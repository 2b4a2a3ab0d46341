// What a run folder offers to those who come later: its policy, and the address of its replay server.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "nn/policy.h"

namespace dbr {

// Reads the policy in a file, or the newest one of a run folder. NotFound, DataLoss or InvalidArgument,
// naming the file.
absl::StatusOr<std::shared_ptr<const PolicyNetworks>> OpenPolicy(const std::string& file_or_run);

// The address of a replay server that is given by itself, by a run folder or by a socket's path.
// InvalidArgument for anything else, and errors of reading the run's config.
absl::StatusOr<std::string> ReplayAddress(const std::string& address_or_run);

}  // namespace dbr
