#include "deploy/manual/command_tree.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace dbr {
namespace {

std::vector<OptionFacts> Select(const std::vector<OptionFacts>& options, bool positional) {
  std::vector<OptionFacts> selected;
  std::copy_if(options.begin(), options.end(), std::back_inserter(selected),
               [positional](const OptionFacts& option) { return option.names.empty() == positional; });
  return selected;
}

OptionFacts ReadOption(const CLI::Option& option) {
  OptionFacts facts;
  for (const std::string& name : option.get_snames()) facts.names.push_back(absl::StrCat("-", name));
  for (const std::string& name : option.get_lnames()) facts.names.push_back(absl::StrCat("--", name));
  if (facts.names.empty()) facts.positional = option.get_name(/*positional=*/true);
  facts.text = option.get_description();
  facts.default_value = option.get_default_str();
  facts.required = option.get_required();
  if (option.get_type_size() == 0) return facts;
  facts.value = option.get_type_name();
  facts.repeated =
      option.get_expected_max() > 1 || option.get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
  // CLI11 appends the descriptions of validators: "N:INT in [1 - 1024]". A choice may itself have a colon.
  const std::size_t colon = facts.value.find(':');
  if (colon != std::string::npos && !absl::StrContains(facts.value, '|')) {
    facts.bounds = facts.value.substr(colon + 1);
    facts.value.resize(colon);
  }
  return facts;
}

CommandFacts Read(const CLI::App& app, const std::string& name) {
  CommandFacts facts{name, app.get_description(), app.get_footer(), {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) facts.options.push_back(ReadOption(*option));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!command->get_group().empty())
      facts.commands.push_back(Read(*command, absl::StrCat(name, " ", command->get_name())));
  }
  return facts;
}

}  // namespace

ValueKind OptionFacts::kind() const {
  if (value.empty()) return ValueKind::kNone;
  if (absl::StrContains(value, '|')) return ValueKind::kChoice;
  if (value == "DIR") return ValueKind::kFolder;
  return value == "FILE" || absl::EndsWith(value, "_OR_RUN") ? ValueKind::kFile : ValueKind::kOther;
}

std::vector<std::string> OptionFacts::choices() const {
  if (kind() != ValueKind::kChoice) return {};
  std::vector<std::string> typed;
  for (const std::string& choice : std::vector<std::string>(absl::StrSplit(value, '|'))) {
    if (std::none_of(choice.begin(), choice.end(), absl::ascii_isupper)) typed.push_back(choice);
  }
  return typed;
}

std::string CommandFacts::word() const {
  return name.substr(name.rfind(' ') + 1);
}

std::vector<OptionFacts> CommandFacts::positionals() const {
  return Select(options, /*positional=*/true);
}

std::vector<OptionFacts> CommandFacts::flags() const {
  return Select(options, /*positional=*/false);
}

CommandFacts ReadCommands(const CLI::App& app) {
  return Read(app, app.get_name());
}

}  // namespace dbr
