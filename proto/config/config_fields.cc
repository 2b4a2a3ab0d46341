#include "proto/config/config_fields.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "proto/config.pb.h"

namespace dbr {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// Returns Levenshtein's distance: the number of inserted, removed and replaced characters. O(|a| |b|).
std::size_t EditDistance(absl::string_view a, absl::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] != b[j - 1] ? 1 : 0);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

std::string Expected(absl::string_view what, absl::string_view found) {
  return absl::StrCat("expected ", what, ", found '", found, "'");
}

// Parses decimal, 0x hexadecimal or 0 octal digits, as the text format does, and nothing else.
std::optional<std::uint64_t> ParseDigits(const std::string& text) {
  if (text.empty() || !absl::ascii_isdigit(static_cast<unsigned char>(text[0]))) return std::nullopt;
  errno = 0;
  char* end = nullptr;
  const std::uint64_t value = std::strtoull(text.c_str(), &end, 0);
  if (errno != 0 || *end != '\0') return std::nullopt;
  return value;
}

template <class Integer>
std::optional<Integer> ParseWhole(absl::string_view text) {
  const bool negative = !text.empty() && text[0] == '-';
  const auto digits = ParseDigits(std::string(negative ? text.substr(1) : text));
  if (!digits) return std::nullopt;
  using Limits = std::numeric_limits<Integer>;
  if (!negative)
    return *digits <= static_cast<std::uint64_t>(Limits::max()) ? std::optional<Integer>(*digits)
                                                                : std::nullopt;
  const std::uint64_t most =
      ~static_cast<std::uint64_t>(Limits::min()) + 1;  // |min|, which is 0 for unsigned types
  return *digits <= most ? std::optional<Integer>(static_cast<Integer>(~*digits + 1)) : std::nullopt;
}

template <class Integer>
std::string SetWhole(absl::string_view text, const FieldDescriptor& field, Message* message,
                     void (Reflection::*set)(Message*, const FieldDescriptor*, Integer) const,
                     void (Reflection::*add)(Message*, const FieldDescriptor*, Integer) const) {
  const auto value = ParseWhole<Integer>(text);
  if (!value) {
    using Limits = std::numeric_limits<Integer>;
    return Expected(absl::StrCat("a whole number of ", Limits::min(), " to ", Limits::max()), text);
  }
  (message->GetReflection()->*(field.is_repeated() ? add : set))(message, &field, *value);
  return "";
}

std::string SetReal(absl::string_view text, const FieldDescriptor& field, Message* message) {
  double value = 0;
  if (!absl::SimpleAtod(text, &value)) return Expected("a number", text);
  const Reflection& reflection = *message->GetReflection();
  const bool repeated = field.is_repeated();
  if (field.cpp_type() == FieldDescriptor::CPPTYPE_FLOAT) {
    const float narrow = static_cast<float>(value);
    repeated ? reflection.AddFloat(message, &field, narrow) : reflection.SetFloat(message, &field, narrow);
  } else {
    repeated ? reflection.AddDouble(message, &field, value) : reflection.SetDouble(message, &field, value);
  }
  return "";
}

std::string SetBool(absl::string_view text, const FieldDescriptor& field, Message* message) {
  const bool yes = text == "true" || text == "1";
  if (!yes && text != "false" && text != "0") return Expected("true or false", text);
  const Reflection& reflection = *message->GetReflection();
  field.is_repeated() ? reflection.AddBool(message, &field, yes) : reflection.SetBool(message, &field, yes);
  return "";
}

// "did you mean 'x'?" with the known name nearest to `name`, or "" where none is near.
std::string Question(const std::string& name, const std::vector<std::string>& known) {
  const std::string lower = absl::AsciiStrToLower(name);
  std::size_t best = std::numeric_limits<std::size_t>::max();
  const std::string* nearest = nullptr;
  for (const std::string& candidate : known) {
    const std::size_t distance = EditDistance(lower, absl::AsciiStrToLower(candidate));
    if (distance < best) {
      best = distance;
      nearest = &candidate;
    }
  }
  const bool is_near = nearest != nullptr && best <= std::max<std::size_t>(2, nearest->size() / 3);
  return is_near ? absl::StrCat("did you mean '", *nearest, "'?") : "";
}

std::string SetEnum(absl::string_view text, const FieldDescriptor& field, Message* message) {
  const std::string name(text);
  const EnumValueDescriptor* value = field.enum_type()->FindValueByName(name);
  if (const auto number = ParseWhole<std::int32_t>(text); number)
    value = field.enum_type()->FindValueByNumber(*number);
  if (value == nullptr) {
    std::vector<std::string> names;
    for (int i = 0; i < field.enum_type()->value_count(); ++i)
      names.push_back(field.enum_type()->value(i)->name());
    const std::string nearest = Question(name, names);
    return absl::StrCat(Expected(absl::StrCat("one of ", absl::StrJoin(names, ", ")), text),
                        nearest.empty() ? "" : "; ", nearest);
  }
  const Reflection& reflection = *message->GetReflection();
  field.is_repeated() ? reflection.AddEnum(message, &field, value)
                      : reflection.SetEnum(message, &field, value);
  return "";
}

std::string SetText(absl::string_view text, const FieldDescriptor& field, Message* message) {
  const Reflection& reflection = *message->GetReflection();
  std::string value(text);
  field.is_repeated() ? reflection.AddString(message, &field, value)
                      : reflection.SetString(message, &field, std::move(value));
  return "";
}

}  // namespace

std::string Suggest(const std::string& name, const std::vector<std::string>& known) {
  const std::string nearest = Question(name, known);
  return nearest.empty() ? absl::StrCat("known: ", absl::StrJoin(known, ", ")) : nearest;
}

const FieldDescriptor* FindField(const std::string& name, const Descriptor& message) {
  if (const FieldDescriptor* field = message.FindFieldByName(name)) return field;
  for (int i = 0; i < message.field_count(); ++i) {
    if (message.field(i)->options().GetExtension(alias) == name && !name.empty()) return message.field(i);
  }
  return nullptr;
}

std::string UnknownField(const std::string& name, const Descriptor& message) {
  std::vector<std::string> known;
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    if (field.options().GetExtension(former_name) == name && !name.empty())
      return absl::StrCat("this field is now called '", field.name(), "'; write that name in its place");
    known.push_back(field.name());
  }
  return absl::StrCat("unknown field; ", Suggest(name, known));
}

std::string SetFromText(absl::string_view text, const FieldDescriptor& field, Message* message) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return SetWhole<std::int32_t>(text, field, message, &Reflection::SetInt32, &Reflection::AddInt32);
    case FieldDescriptor::CPPTYPE_INT64:
      return SetWhole<std::int64_t>(text, field, message, &Reflection::SetInt64, &Reflection::AddInt64);
    case FieldDescriptor::CPPTYPE_UINT32:
      return SetWhole<std::uint32_t>(text, field, message, &Reflection::SetUInt32, &Reflection::AddUInt32);
    case FieldDescriptor::CPPTYPE_UINT64:
      return SetWhole<std::uint64_t>(text, field, message, &Reflection::SetUInt64, &Reflection::AddUInt64);
    case FieldDescriptor::CPPTYPE_FLOAT:
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return SetReal(text, field, message);
    case FieldDescriptor::CPPTYPE_BOOL:
      return SetBool(text, field, message);
    case FieldDescriptor::CPPTYPE_ENUM:
      return SetEnum(text, field, message);
    case FieldDescriptor::CPPTYPE_STRING:
      return SetText(text, field, message);
    case FieldDescriptor::CPPTYPE_MESSAGE:
      break;
  }
  return Expected("fields in braces, { ... }", text);
}

}  // namespace dbr
