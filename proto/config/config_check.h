// Checking a config against the (bounds) and (required_text) options of its schema. For the readers in this
// room.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace dbr {

// Appends to `errors` one line for each violation in `message` and the messages within it: "a.b: expected 0
// to 1, found 2". Numbers must be finite, bounds or not. `path` names `message` within the whole ("" or
// "a.b").
void FindViolations(const google::protobuf::Message& message, const std::string& path,
                    std::vector<std::string>* errors);

// InvalidArgument with all of the errors, a line each: "SOURCE: 2 errors:\n  ..."; OK where there is none.
absl::Status AllErrors(const std::vector<std::string>& errors, absl::string_view source);

}  // namespace dbr
