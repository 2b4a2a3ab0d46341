#include "proto/config/config_check.h"

#include <google/protobuf/descriptor.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "proto/config.pb.h"
#include "proto/config/config_text.h"

namespace dbr {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

std::string Describe(const Bounds& bounds) {
  if (bounds.has_min() && bounds.has_max() && !bounds.exclusive_min() && !bounds.exclusive_max()) {
    return absl::StrCat(bounds.min(), " to ", bounds.max());
  }
  std::vector<std::string> limits;
  if (bounds.has_min())
    limits.push_back(absl::StrCat(bounds.exclusive_min() ? "more than " : "at least ", bounds.min()));
  if (bounds.has_max())
    limits.push_back(absl::StrCat(bounds.exclusive_max() ? "less than " : "at most ", bounds.max()));
  return limits.empty() ? "a finite number" : absl::StrJoin(limits, " and ");
}

bool Within(double value, const Bounds& bounds) {
  if (!std::isfinite(value)) return false;
  if (bounds.has_min() && (value < bounds.min() || (bounds.exclusive_min() && value == bounds.min())))
    return false;
  return !bounds.has_max() || (value <= bounds.max() && !(bounds.exclusive_max() && value == bounds.max()));
}

// Returns the number in a field, or in entry `i` of a repeated one. Whole numbers are rounded to the nearest
// double.
double NumberIn(const Message& message, const FieldDescriptor& field, int i) {
  const Reflection& reflection = *message.GetReflection();
  const bool repeated = field.is_repeated();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return repeated ? reflection.GetRepeatedInt32(message, &field, i)
                      : reflection.GetInt32(message, &field);
    case FieldDescriptor::CPPTYPE_INT64:
      return repeated ? reflection.GetRepeatedInt64(message, &field, i)
                      : reflection.GetInt64(message, &field);
    case FieldDescriptor::CPPTYPE_UINT32:
      return repeated ? reflection.GetRepeatedUInt32(message, &field, i)
                      : reflection.GetUInt32(message, &field);
    case FieldDescriptor::CPPTYPE_UINT64:
      return repeated ? reflection.GetRepeatedUInt64(message, &field, i)
                      : reflection.GetUInt64(message, &field);
    case FieldDescriptor::CPPTYPE_FLOAT:
      return repeated ? reflection.GetRepeatedFloat(message, &field, i)
                      : reflection.GetFloat(message, &field);
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return repeated ? reflection.GetRepeatedDouble(message, &field, i)
                      : reflection.GetDouble(message, &field);
    default:
      return 0;
  }
}

bool IsNumber(const FieldDescriptor& field) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
    case FieldDescriptor::CPPTYPE_STRING:
    case FieldDescriptor::CPPTYPE_ENUM:
    case FieldDescriptor::CPPTYPE_BOOL:
      return false;
    default:
      return true;
  }
}

void CheckNumbers(const Message& message, const FieldDescriptor& field, const std::string& path,
                  std::vector<std::string>* errors) {
  const Bounds& bounds = field.options().GetExtension(dbr::bounds);
  const int count = field.is_repeated() ? message.GetReflection()->FieldSize(message, &field) : 1;
  for (int i = 0; i < count; ++i) {
    const double value = NumberIn(message, field, i);
    if (Within(value, bounds)) continue;
    const std::string entry = field.is_repeated() ? absl::StrCat("[", i, "]") : "";
    errors->push_back(absl::StrCat(path, entry, ": expected ", Describe(bounds), ", found ", value));
  }
}

void CheckText(const Message& message, const FieldDescriptor& field, const std::string& path,
               std::vector<std::string>* errors) {
  if (!field.options().GetExtension(required_text)) return;
  const Reflection& reflection = *message.GetReflection();
  const int count = field.is_repeated() ? reflection.FieldSize(message, &field) : 1;
  for (int i = 0; i < count; ++i) {
    const std::string text = field.is_repeated() ? reflection.GetRepeatedString(message, &field, i)
                                                 : reflection.GetString(message, &field);
    if (text.empty()) errors->push_back(absl::StrCat(path, ": expected a text, found an empty one"));
  }
}

}  // namespace

void FindViolations(const Message& message, const std::string& path, std::vector<std::string>* errors) {
  const Reflection& reflection = *message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor& field = *message.GetDescriptor()->field(i);
    const std::string field_path = JoinPath(path, field.name());
    if (IsNumber(field)) CheckNumbers(message, field, field_path, errors);
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) CheckText(message, field, field_path, errors);
    if (field.cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
    const int count = field.is_repeated() ? reflection.FieldSize(message, &field) : 0;
    for (int entry = 0; entry < count; ++entry) {
      FindViolations(reflection.GetRepeatedMessage(message, &field, entry),
                     absl::StrCat(field_path, "[", entry, "]"), errors);
    }
    // A message that is not set has the schema's defaults, which are within their bounds.
    if (!field.is_repeated() && reflection.HasField(message, &field)) {
      FindViolations(reflection.GetMessage(message, &field), field_path, errors);
    }
  }
}

absl::Status AllErrors(const std::vector<std::string>& errors, absl::string_view source) {
  if (errors.empty()) return absl::OkStatus();
  if (errors.size() == 1) return absl::InvalidArgumentError(absl::StrCat(source, ": ", errors[0]));
  return absl::InvalidArgumentError(
      absl::StrCat(source, ": ", errors.size(), " errors:\n  ", absl::StrJoin(errors, "\n  ")));
}

}  // namespace dbr
