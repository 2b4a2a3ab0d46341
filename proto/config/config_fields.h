// Sets one field of a config from text, and suggests a known name for a wrong one. Thread-safe: pure
// functions.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// Returns "did you mean 'x'?" with the known name nearest to `name`, or a list of all known names where none
// is near. O(known.size() * name.size() * length of a known name).
std::string Suggest(const std::string& name, const std::vector<std::string>& known);

// Returns the field of `message` with that name or alias, or null where there is none.
const google::protobuf::FieldDescriptor* FindField(const std::string& name,
                                                   const google::protobuf::Descriptor& message);

// Returns the text that follows "path: " in an error about a wrong name: "unknown field; did you mean
// 'discount'?", or all names where none is near. For a former name it says the field's name of today.
std::string UnknownField(const std::string& name, const google::protobuf::Descriptor& message);

// Sets a scalar or enum field, or appends to a repeated one, from unquoted text. Returns "" where that
// worked, else "expected a whole number of 0 to 4294967295, found 'x'". Does not check the schema's bounds.
std::string SetFromText(absl::string_view text, const google::protobuf::FieldDescriptor& field,
                        google::protobuf::Message* message);

}  // namespace dbr
