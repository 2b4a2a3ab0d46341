#include "proto/config/config_override.h"

#include <google/protobuf/descriptor.h>

#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "proto/config/config_fields.h"
#include "proto/config/config_text.h"

namespace dbr {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// Returns the entries of "[a, b]" or "a". Quotes around an entry are removed; a comma within them is part of
// the entry.
std::vector<std::string> SplitEntries(absl::string_view text) {
  if (!(absl::ConsumePrefix(&text, "[") && absl::ConsumeSuffix(&text, "]"))) return {std::string(text)};
  std::vector<std::string> entries;
  std::string entry;
  char quote = 0;
  for (const char c : text) {
    if (c == ',' && quote == 0) {
      entries.emplace_back(absl::StripAsciiWhitespace(entry));
      entry.clear();
      continue;
    }
    if (quote != 0 && c == quote)
      quote = 0;
    else if (quote == 0 && (c == '"' || c == '\''))
      quote = c;
    entry += c;
  }
  const absl::string_view last = absl::StripAsciiWhitespace(entry);
  if (!last.empty() || !entries.empty()) entries.emplace_back(last);
  return entries;
}

std::string Unquote(const std::string& text) {
  const bool quoted = text.size() >= 2 && (text[0] == '"' || text[0] == '\'') && text.back() == text[0];
  std::string plain;
  return quoted && absl::CUnescape(absl::string_view(text).substr(1, text.size() - 2), &plain) ? plain : text;
}

// Replaces the field by `value`: fields in braces for a message, entries for a list, a scalar otherwise.
void Replace(const std::string& path, absl::string_view value, const FieldDescriptor& field, Message* message,
             std::vector<std::string>* errors) {
  const Reflection& reflection = *message->GetReflection();
  reflection.ClearField(message, &field);
  if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
    if (!absl::ConsumePrefix(&value, "{") || !absl::ConsumeSuffix(&value, "}") || field.is_repeated()) {
      errors->push_back(absl::StrCat(
          path, ": expected the path of a field within it, or fields in braces, found '", value, "'"));
      return;
    }
    ReadText(value, path, reflection.MutableMessage(message, &field), errors);
    return;
  }
  const auto entries =
      field.is_repeated() ? SplitEntries(value) : std::vector<std::string>{std::string(value)};
  for (const std::string& entry : entries) {
    const bool text = field.cpp_type() == FieldDescriptor::CPPTYPE_STRING;
    const std::string error = SetFromText(text ? Unquote(entry) : entry, field, message);
    if (!error.empty()) errors->push_back(absl::StrCat(path, ": ", error));
  }
}

}  // namespace

void ApplyOverride(absl::string_view setting, Message* message, std::vector<std::string>* errors) {
  const std::pair<absl::string_view, absl::string_view> parts =
      absl::StrSplit(setting, absl::MaxSplits('=', 1));
  if (!absl::StrContains(setting, '=')) {
    errors->push_back(absl::StrCat("expected path.to.field=value, found '", setting, "'"));
    return;
  }
  const std::vector<std::string> names = absl::StrSplit(absl::StripAsciiWhitespace(parts.first), '.');
  std::string path;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const FieldDescriptor* field = FindField(names[i], *message->GetDescriptor());
    path = JoinPath(path, names[i]);
    if (field == nullptr) {
      errors->push_back(absl::StrCat(path, ": ", UnknownField(names[i], *message->GetDescriptor())));
      return;
    }
    if (i + 1 == names.size())
      return Replace(path, absl::StripAsciiWhitespace(parts.second), *field, message, errors);
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE || field->is_repeated()) {
      errors->push_back(absl::StrCat(path, ": has no fields within it, found '", names[i + 1], "'"));
      return;
    }
    message = message->GetReflection()->MutableMessage(message, field);
  }
}

}  // namespace dbr
