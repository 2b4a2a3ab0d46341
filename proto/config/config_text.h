// Reads the text format of Protobuf, going on after an error so that all of them are reported at once.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// Merges `text` into `message`. Appends to `errors` one line for each thing that is wrong, "LINE:COLUMN:
// path: what": unknown fields with the nearest known name, values of another type, fields given twice. A
// broken structure (a missing brace) ends the reading, for what follows it has no sure meaning. `path` names
// `message` within the whole ("" or "a.b").
void ReadText(absl::string_view text, const std::string& path, google::protobuf::Message* message,
              std::vector<std::string>* errors);

// "a.b" from "a" and "b".
std::string JoinPath(const std::string& path, const std::string& name);

}  // namespace dbr
