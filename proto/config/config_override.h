// One "--set path.to.field=value". For the readers in this room.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// Applies "path.to.field=value" to `message`: a scalar, a list "[a, b]" or "a" that replaces the field's
// entries, or the fields of a message in braces. Text needs no quotes. Appends to `errors` what is wrong,
// each with the path.
void ApplyOverride(absl::string_view setting, google::protobuf::Message* message,
                   std::vector<std::string>* errors);

}  // namespace dbr
