#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "deploy/manual/completion.h"

namespace dbr {
namespace {

std::string Quote(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"\\", "\\\\"}, {"'", "\\'"}}), "'");
}

// The switches of `complete` that say what completes a value.
std::string ValueSwitches(const OptionFacts& option) {
  switch (option.kind()) {
    case ValueKind::kNone:
      return "";
    case ValueKind::kFile:
      return " -r -F";
    case ValueKind::kFolder:
      return " -x -a '(__fish_complete_directories)'";
    case ValueKind::kChoice:
      return absl::StrCat(" -x -a ", Quote(absl::StrJoin(option.choices(), " ")));
    case ValueKind::kOther:
      return " -x";
  }
  return "";
}

std::string Switches(const OptionFacts& option) {
  std::string switches;
  for (const std::string& name : option.names) {
    const bool is_long = absl::StartsWith(name, "--");
    absl::StrAppend(&switches, is_long ? " -l " : " -s ", name.substr(is_long ? 2 : 1));
  }
  return absl::StrCat(switches, ValueSwitches(option), " -d ", Quote(option.text));
}

// `seen`: the condition, in fish, that the words of `command` have been typed; "" for the program itself.
void AppendCommand(const std::string& program, const CommandFacts& command, const std::string& seen,
                   std::string* script) {
  std::vector<std::string> words;
  for (const CommandFacts& below : command.commands) words.push_back(below.word());
  const std::string none_below = absl::StrCat("not __fish_seen_subcommand_from ", absl::StrJoin(words, " "));
  std::string here = seen;
  if (!words.empty()) here = seen.empty() ? none_below : absl::StrCat(seen, "; and ", none_below);
  const std::string begin =
      absl::StrCat("complete -c ", program, here.empty() ? "" : absl::StrCat(" -n ", Quote(here)));
  for (const OptionFacts& option : command.flags()) absl::StrAppend(script, begin, Switches(option), "\n");
  for (const OptionFacts& option : command.positionals()) {
    if (option.kind() != ValueKind::kOther) absl::StrAppend(script, begin, ValueSwitches(option), "\n");
  }
  for (const CommandFacts& below : command.commands)
    absl::StrAppend(script, begin, " -a ", below.word(), " -d ", Quote(below.text), "\n");
  for (const CommandFacts& below : command.commands) {
    const std::string word = absl::StrCat("__fish_seen_subcommand_from ", below.word());
    AppendCommand(program, below, seen.empty() ? word : absl::StrCat(seen, "; and ", word), script);
  }
}

}  // namespace

std::string FishCompletion(const CommandFacts& program) {
  std::string script =
      absl::StrCat("# Completion of ", program.name,
                   " in fish; it comes from the program itself.\ncomplete -c ", program.name, " -f\n");
  AppendCommand(program.name, program, "", &script);
  return script;
}

}  // namespace dbr
