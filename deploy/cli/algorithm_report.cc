#include "deploy/cli/algorithm_report.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/check.h"
#include "deploy/terminal/terminal.h"
#include "learner/algorithms/registry.h"
#include "proto/config.pb.h"
#include "proto/config/config_fields.h"

namespace dbr {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::MessageFactory;
using google::protobuf::TextFormat;
using Json = nlohmann::ordered_json;

const char* NameOf(ActionKind kind) {
  return kind == ActionKind::kDiscrete ? "discrete" : "continuous";
}

std::string ActionsText(const AlgorithmFacts& algorithm) {
  return absl::StrJoin(algorithm.actions, ", ",
                       [](std::string* out, ActionKind kind) { out->append(NameOf(kind)); });
}

// The config message of an algorithm: the member of AlgorithmConfig's oneof that has its name.
const Descriptor& MessageOf(const std::string& algorithm) {
  const FieldDescriptor* field = AlgorithmConfig::descriptor()->FindFieldByName(algorithm);
  DBR_CHECK(field != nullptr && field->message_type() != nullptr);
  return *field->message_type();
}

// What an enum or a switch can be; empty for others.
std::vector<std::string> ValuesOf(const FieldDescriptor& field) {
  if (field.type() == FieldDescriptor::TYPE_BOOL) return {"false", "true"};
  std::vector<std::string> values;
  if (field.enum_type() == nullptr) return values;
  for (int i = 0; i < field.enum_type()->value_count(); ++i)
    values.push_back(field.enum_type()->value(i)->name());
  return values;
}

std::string DefaultOf(const FieldDescriptor& field) {
  if (field.is_repeated()) return "[]";
  const Message& none = *MessageFactory::generated_factory()->GetPrototype(field.containing_type());
  std::string text;
  TextFormat::PrintFieldValueToString(none, &field, -1, &text);
  return text;
}

// "0 to 1", "above 0", "0 or more"; empty where the schema sets no limit.
std::string BoundsText(const FieldDescriptor& field) {
  if (!field.options().HasExtension(bounds)) return "";
  const Bounds& limits = field.options().GetExtension(bounds);
  const std::string low =
      !limits.has_min() ? "" : absl::StrCat(limits.exclusive_min() ? "above " : "", limits.min());
  const std::string high = absl::StrCat(limits.exclusive_max() ? "below " : "", limits.max());
  if (!limits.has_max()) return limits.exclusive_min() ? low : absl::StrCat(low, " or more");
  return low.empty() ? absl::StrCat("at most ", high) : absl::StrCat(low, " to ", high);
}

// What a field takes, for a comment.
std::string TakesText(const FieldDescriptor& field) {
  const std::vector<std::string> values = ValuesOf(field);
  const std::string takes = values.empty() ? BoundsText(field) : absl::StrJoin(values, " | ");
  if (!field.is_repeated()) return takes;
  return absl::StrCat("a list", takes.empty() ? "" : absl::StrCat(", each ", takes));
}

std::string VariantText(const AlgorithmFacts& algorithm, const std::string& variant) {
  const FieldDescriptor* field = MessageOf(algorithm.name).FindFieldByName(variant);
  DBR_CHECK(field != nullptr);
  return absl::StrCat(variant, ": ", TakesText(*field));
}

int Widest(const std::vector<std::string>& column) {
  int width = 0;
  for (const std::string& text : column) width = std::max(width, DisplayWidth(text));
  return width;
}

Json FieldJson(const FieldDescriptor& field) {
  Json json = {{"name", field.name()},
               {"type", field.enum_type() != nullptr ? "enum" : field.type_name()},
               {"repeated", field.is_repeated()},
               {"default", DefaultOf(field)}};
  const std::vector<std::string> values = ValuesOf(field);
  json["values"] = values.empty() ? Json(nullptr) : Json(values);
  const std::string limits = BoundsText(field);
  json["bounds"] = limits.empty() ? Json(nullptr) : Json(limits);
  return json;
}

}  // namespace

std::vector<AlgorithmFacts> AllAlgorithms() {
  std::vector<AlgorithmFacts> all;
  for (const AlgorithmId& id : Algorithms()) {
    const auto same = [&id](const AlgorithmFacts& one) { return one.name == id.name; };
    const auto found = std::find_if(all.begin(), all.end(), same);
    if (found != all.end()) {
      found->actions.push_back(id.actions);
      continue;
    }
    all.push_back({id.name, {id.actions}, id.source, absl::StrSplit(id.variants, ", ", absl::SkipEmpty())});
  }
  return all;
}

absl::StatusOr<AlgorithmFacts> FindAlgorithm(const std::string& name) {
  std::vector<std::string> known;
  for (const AlgorithmFacts& one : AllAlgorithms()) {
    if (one.name == name) return one;
    known.push_back(one.name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("NAME: expected an algorithm, found '", name, "'; ", Suggest(name, known)));
}

std::string AlgorithmTable(const std::vector<AlgorithmFacts>& algorithms) {
  std::vector<std::string> names = {"algorithm"}, actions = {"actions"}, sources = {"source"};
  for (const AlgorithmFacts& one : algorithms) {
    names.push_back(one.name);
    actions.push_back(ActionsText(one));
    sources.push_back(one.source);
  }
  const int name_width = Widest(names) + 2, action_width = Widest(actions) + 2,
            source_width = Widest(sources) + 2;
  const std::string indent(name_width + action_width + source_width, ' ');
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    absl::StrAppend(&text, PadRight(names[i], name_width), PadRight(actions[i], action_width),
                    PadRight(sources[i], source_width));
    std::vector<std::string> variants = {i == 0 ? "variants" : "–"};
    if (i > 0 && !algorithms[i - 1].variants.empty()) {
      variants.clear();
      for (const std::string& variant : algorithms[i - 1].variants)
        variants.push_back(VariantText(algorithms[i - 1], variant));
    }
    absl::StrAppend(&text, absl::StrJoin(variants, absl::StrCat("\n", indent)), "\n");
  }
  return text;
}

std::string AlgorithmText(const AlgorithmFacts& algorithm) {
  const Descriptor& message = MessageOf(algorithm.name);
  std::vector<std::string> settings;
  for (int i = 0; i < message.field_count(); ++i)
    settings.push_back(absl::StrCat("    ", message.field(i)->name(), ": ", DefaultOf(*message.field(i))));
  const int width = Widest(settings) + 2;
  std::string text =
      absl::StrCat("# ", algorithm.name, ": ", algorithm.source, "; ", ActionsText(algorithm),
                   " actions. Each field at its default.\nalgorithm {\n  ", algorithm.name, " {\n");
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    std::string takes = TakesText(field);
    const bool variant = std::count(algorithm.variants.begin(), algorithm.variants.end(), field.name()) > 0;
    if (variant) absl::StrAppend(&takes, takes.empty() ? "" : "; ", "a variant");
    absl::StrAppend(
        &text, takes.empty() ? settings[i] : absl::StrCat(PadRight(settings[i], width), "# ", takes), "\n");
  }
  return text + "  }\n}\n";
}

Json ToJson(const AlgorithmFacts& algorithm) {
  const Descriptor& message = MessageOf(algorithm.name);
  Json actions = Json::array(), variants = Json::object(), fields = Json::array();
  for (const ActionKind kind : algorithm.actions) actions.push_back(NameOf(kind));
  for (const std::string& variant : algorithm.variants) {
    const FieldDescriptor* field = message.FindFieldByName(variant);
    DBR_CHECK(field != nullptr);
    variants[variant] = FieldJson(*field)["values"];
  }
  for (int i = 0; i < message.field_count(); ++i) fields.push_back(FieldJson(*message.field(i)));
  return {{"name", algorithm.name},
          {"actions", actions},
          {"source", algorithm.source},
          {"variants", variants},
          {"fields", fields}};
}

}  // namespace dbr
