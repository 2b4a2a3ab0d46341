// JSON from files that anybody may have written.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// What our own files need is far below. Values that are nested deeper would exhaust the stack where they are
// copied or printed, and a text takes some twenty times its size once it is read.
inline constexpr int kMostJsonDepth = 64;
inline constexpr std::size_t kMostJsonBytes = std::size_t{32} << 20;

// Reads one JSON value. InvalidArgument where the text is none, is longer than kMostJsonBytes or has lists
// and objects within each other more than kMostJsonDepth deep; its message says what was found alone, for the
// caller knows the file's name and what was expected.
absl::StatusOr<nlohmann::json> ParseJson(absl::string_view text);

}  // namespace dbr
