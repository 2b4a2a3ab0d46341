#include "proto/config/config_file.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "proto/config/config_check.h"
#include "proto/config/config_combinations.h"
#include "proto/config/config_override.h"
#include "proto/config/config_text.h"

namespace dbr {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

void SetDefault(const FieldDescriptor& field, Message* message) {
  const Reflection& reflection = *message->GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return reflection.SetInt32(message, &field, field.default_value_int32());
    case FieldDescriptor::CPPTYPE_INT64:
      return reflection.SetInt64(message, &field, field.default_value_int64());
    case FieldDescriptor::CPPTYPE_UINT32:
      return reflection.SetUInt32(message, &field, field.default_value_uint32());
    case FieldDescriptor::CPPTYPE_UINT64:
      return reflection.SetUInt64(message, &field, field.default_value_uint64());
    case FieldDescriptor::CPPTYPE_FLOAT:
      return reflection.SetFloat(message, &field, field.default_value_float());
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return reflection.SetDouble(message, &field, field.default_value_double());
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection.SetBool(message, &field, field.default_value_bool());
    case FieldDescriptor::CPPTYPE_ENUM:
      return reflection.SetEnum(message, &field, field.default_value_enum());
    case FieldDescriptor::CPPTYPE_STRING:
      return reflection.SetString(message, &field, field.default_value_string());
    case FieldDescriptor::CPPTYPE_MESSAGE:
      break;
  }
  reflection.MutableMessage(message, &field);
}

// Sets every field that is not set to its default. In a oneof it touches only the member that is set.
void Materialise(Message* message) {
  const Reflection& reflection = *message->GetReflection();
  for (int i = 0; i < message->GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor& field = *message->GetDescriptor()->field(i);
    if (field.is_repeated()) continue;
    const bool has = reflection.HasField(*message, &field);
    if (!has && field.containing_oneof() != nullptr) continue;
    if (!has) SetDefault(field, message);
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE)
      Materialise(reflection.MutableMessage(message, &field));
  }
}

void DefaultAlgorithm(Config* config) {
  if (config->algorithm().algorithm_case() == AlgorithmConfig::ALGORITHM_NOT_SET)
    config->mutable_algorithm()->mutable_dbr();
}

absl::StatusOr<Config> Parse(absl::string_view text, const std::vector<std::string>& overrides,
                             const std::string& source) {
  Config config;
  std::vector<std::string> errors;
  ReadText(text, "", &config, &errors);
  for (const std::string& setting : overrides) {
    std::vector<std::string> found;
    ApplyOverride(setting, &config, &found);
    for (const std::string& error : found) errors.push_back(absl::StrCat("--set ", error));
  }
  DefaultAlgorithm(&config);
  FindViolations(config, "", &errors);
  FindContradictions(config, &errors);
  RETURN_IF_ERROR(AllErrors(errors, source));
  return config;
}

}  // namespace

absl::StatusOr<Config> LoadConfig(const std::string& path, const std::vector<std::string>& overrides) {
  ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
  return Parse(text, overrides, path);
}

absl::StatusOr<Config> ParseConfig(absl::string_view text, const std::vector<std::string>& overrides) {
  return Parse(text, overrides, "config");
}

Config WithDefaults(const Config& config) {
  Config whole = config;
  DefaultAlgorithm(&whole);
  Materialise(&whole);
  const std::vector<int> sizes = HiddenSizes(config);
  whole.mutable_network()->mutable_hidden_sizes()->Assign(sizes.begin(), sizes.end());
  return whole;
}

std::string PrintConfig(const Config& config) {
  google::protobuf::TextFormat::Printer printer;
  printer.SetUseShortRepeatedPrimitives(true);
  std::string text;
  printer.PrintToString(WithDefaults(config), &text);
  return text;
}

bool TrainsOfflineAlone(const Config& config) {
  const LearnerConfig& learner = config.learner();
  return learner.max_updates() > 0 && learner.max_updates() <= learner.offline_updates();
}

OptionalColumns OptionalColumnsOf(const AlgorithmConfig& config) {
  return {.returns = config.dbr().advantage() == DbrConfig::SIL || config.has_cal_ql(),
          .next_actions = config.has_rebrac() && config.rebrac().critic_penalty() > 0};
}

std::vector<int> HiddenSizes(const Config& config) {
  if (config.network().hidden_sizes().empty()) return {256, 256, 256};
  return {config.network().hidden_sizes().begin(), config.network().hidden_sizes().end()};
}

}  // namespace dbr
