#include "core/json_text.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"

namespace dbr {
namespace {

// How deep lists and objects lie within each other. Brackets within texts do not count. For a text that is no
// JSON it may be any number, and the parser refuses it.
int DepthOf(absl::string_view text) {
  int depth = 0, deepest = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size() && deepest <= kMostJsonDepth; ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      quoted = c != '"';
    } else if (c == '[' || c == '{') {
      deepest = std::max(deepest, ++depth);
    } else if (c == ']' || c == '}') {
      --depth;
    } else {
      quoted = c == '"';
    }
  }
  return deepest;
}

}  // namespace

absl::StatusOr<nlohmann::json> ParseJson(absl::string_view text) {
  if (text.size() > kMostJsonBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(text.size(), " bytes of JSON, of which at most ", kMostJsonBytes, " are read"));
  }
  if (DepthOf(text) > kMostJsonDepth) {
    return absl::InvalidArgumentError(
        absl::StrCat("lists and objects more than ", kMostJsonDepth, " deep within each other"));
  }
  nlohmann::json json = nlohmann::json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return absl::InvalidArgumentError("text that is no JSON");
  return json;
}

}  // namespace dbr
