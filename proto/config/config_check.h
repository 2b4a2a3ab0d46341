// Checks a config against the (bounds) and (required_text) options of its schema. Only the readers in this
// folder use it.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace dbr {

// Appends to `errors` one line for each violation in `message` and in the messages within it: "a.b: expected
// 0 to 1, found 2". Numbers must be finite, with or without bounds. `path` names `message` within the whole
// ("" or "a.b"). O(fields that are set).
void FindViolations(const google::protobuf::Message& message, const std::string& path,
                    std::vector<std::string>* errors);

// Returns InvalidArgument with all of the errors, one on a line: "SOURCE: 2 errors:\n ...". Returns OK where
// there is none.
absl::Status AllErrors(const std::vector<std::string>& errors, absl::string_view source);

}  // namespace dbr
