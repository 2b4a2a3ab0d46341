// The version of what our programs say to each other, and the error of two programs that do not fit.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace dbr {

// The version of proto/replay.proto and proto/policy.proto with the rules of their streams. It grows with a
// change that a program of the version before would misunderstand, and not with a new field, which such a
// program ignores. The opening message of a stream, the answer to it, each policy and each reply of Stats and
// Status carry it; 0 there means a program from before 0.2.0, which does not say its version.
inline constexpr std::uint32_t kProtocolVersion = 2;

// Compares the version `found` in a message of `sender` with that of this program, which reads it as
// `reader`; both are words for people, as "the writer actor-0" and "the replay server". FailedPrecondition,
// a final error (proto/rpc/grpc_status.h), where they differ: it says both versions, which of the two is the
// older program, and what to do.
absl::Status CheckProtocolVersion(std::uint32_t found, absl::string_view sender, absl::string_view reader);

}  // namespace dbr
