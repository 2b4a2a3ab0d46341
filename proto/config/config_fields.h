// Setting one field of a config from its text, and naming what is near to a wrong name.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// "did you mean 'x'?", or all that are known where none is near.
std::string Suggest(const std::string& name, const std::vector<std::string>& known);

// The field of a config's name in `message`: by its own name or its alias. Null where there is none.
const google::protobuf::FieldDescriptor* FindField(const std::string& name,
                                                   const google::protobuf::Descriptor& message);

// What follows "path: " in a message about a wrong name: "unknown field; did you mean 'discount'?", or all
// names where none is near. A former name of a field is answered with the name that it has now.
std::string UnknownField(const std::string& name, const google::protobuf::Descriptor& message);

// Sets a scalar or enum field, or appends to a repeated one, from unquoted text. Returns "" or
// "expected a whole number of 0 to 4294967295, found 'x'". Bounds of the schema are not looked at.
std::string SetFromText(absl::string_view text, const google::protobuf::FieldDescriptor& field,
                        google::protobuf::Message* message);

}  // namespace dbr
