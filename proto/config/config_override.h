// Applies one "--set path.to.field=value". Only the readers in this folder use it.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// Applies "path.to.field=value" to `message`. The value is a scalar, a list "[a, b]" or "a" that replaces the
// field's entries, or the fields of a message in braces. Text needs no quotes. Appends each error to
// `errors`, with its path.
void ApplyOverride(absl::string_view setting, google::protobuf::Message* message,
                   std::vector<std::string>* errors);

}  // namespace dbr
