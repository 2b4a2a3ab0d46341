#include "deploy/report/settings.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/crc32c.h"
#include "core/status_macros.h"
#include "deploy/launch/same_run.h"
#include "proto/config/config_file.h"
#include "proto/config/config_text.h"

namespace dbr::report {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::TextFormat;

// The value as the text format has it. `index` is -1 for a field that is not repeated.
std::string ValueText(const Message& message, const FieldDescriptor& field, int index) {
  std::string text;
  TextFormat::PrintFieldValueToString(message, &field, index, &text);
  return text;
}

std::string ListText(const Message& message, const FieldDescriptor& field) {
  std::string text = "[";
  const int size = message.GetReflection()->FieldSize(message, &field);
  for (int i = 0; i < size; ++i) absl::StrAppend(&text, i == 0 ? "" : ", ", ValueText(message, field, i));
  return text + "]";
}

// Appends the fields of `message` that differ from those of `defaults`. A member of a oneof that is set
// counts even where all within it is at its default.
void AppendDifferences(const Message& message, const Message& defaults, const std::string& path,
                       std::string* lines) {
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor& field = *message.GetDescriptor()->field(i);
    const std::string name = JoinPath(path, field.name());
    if (field.is_repeated()) {
      const std::string list = ListText(message, field);
      if (list != ListText(defaults, field)) absl::StrAppend(lines, name, ": ", list, "\n");
      continue;
    }
    if (!message.GetReflection()->HasField(message, &field)) continue;
    if (field.cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) {
      const std::string value = ValueText(message, field, -1);
      if (value != ValueText(defaults, field, -1)) absl::StrAppend(lines, name, ": ", value, "\n");
      continue;
    }
    const std::size_t before = lines->size();
    AppendDifferences(message.GetReflection()->GetMessage(message, &field),
                      defaults.GetReflection()->GetMessage(defaults, &field), name, lines);
    if (field.containing_oneof() != nullptr && lines->size() == before) absl::StrAppend(lines, name, " {}\n");
  }
}

// The empty config with its defaults filled in.
const Config& DefaultConfig() {
  static const auto* config = new Config(WithDefaults(Config()));
  return *config;
}

}  // namespace

Settings SettingsOf(const Config& config) {
  Config seedless = OutcomeConfig(config);
  seedless.set_seed(DefaultConfig().seed());
  const std::string text = PrintConfig(seedless);
  Settings settings;
  AppendDifferences(seedless, DefaultConfig(), "", &settings.differences);
  settings.digest = absl::StrFormat("%08x", Crc32c(text.data(), text.size()));
  return settings;
}

absl::StatusOr<Settings> LoadSettings(const std::string& path) {
  ASSIGN_OR_RETURN(const Config config, LoadConfig(path));
  return SettingsOf(config);
}

}  // namespace dbr::report
