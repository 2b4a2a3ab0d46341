// Reads the text format of Protobuf. The reader continues after an error, so that it reports all errors at
// once.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// Merges `text` into `message`. Appends to `errors` one line for each error, "LINE:COLUMN: path: what":
// unknown fields with the nearest known name, values of another type, fields given twice. A broken structure
// (for example a missing brace) ends the reading, because the text after it has no certain meaning. `path`
// names `message` within the whole ("" or "a.b").
void ReadText(absl::string_view text, const std::string& path, google::protobuf::Message* message,
              std::vector<std::string>* errors);

// Returns "a.b" for "a" and "b", and "b" where `path` is empty.
std::string JoinPath(const std::string& path, const std::string& name);

}  // namespace dbr
