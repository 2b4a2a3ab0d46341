#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "deploy/manual/completion.h"

namespace dbr {
namespace {

// Within single quotes, where _arguments and _describe give brackets and colons a meaning.
std::string Escape(const std::string& text) {
  return absl::StrReplaceAll(text,
                             {{"\\", "\\\\"}, {"'", "'\\''"}, {"[", "\\["}, {"]", "\\]"}, {":", "\\:"}});
}

// ":MESSAGE:ACTION" of a value.
std::string ValueSpec(const OptionFacts& option, const std::string& message) {
  std::string action = " ";
  if (option.kind() == ValueKind::kFile) action = "_files";
  if (option.kind() == ValueKind::kFolder) action = "_files -/";
  if (option.kind() == ValueKind::kChoice)
    action = absl::StrCat("(", absl::StrJoin(option.choices(), " "), ")");
  return absl::StrCat(":", Escape(message), ":", action);
}

std::string FlagSpec(const OptionFacts& option) {
  const bool takes_value = option.kind() != ValueKind::kNone;
  const std::string what =
      absl::StrCat("[", Escape(option.text), "]", takes_value ? ValueSpec(option, option.value) : "");
  if (option.names.size() == 1) {
    return absl::StrCat("'", option.repeated ? "*" : "", option.names[0], takes_value ? "=" : "", what, "'");
  }
  // The value may stand in the same word, after "=", or after a short name at once.
  const auto spell = [takes_value](std::string* out, const std::string& name) {
    absl::StrAppend(out, name, !takes_value ? "" : absl::StartsWith(name, "--") ? "=" : "+");
  };
  return absl::StrCat("'(", absl::StrJoin(option.names, " "), ")'{", absl::StrJoin(option.names, ",", spell),
                      "}'", what, "'");
}

std::string PositionalSpec(const OptionFacts& option, int index) {
  const std::string where = option.repeated ? "*" : absl::StrCat(index, option.required ? "" : ":");
  return absl::StrCat("'", where, ValueSpec(option, option.positional), "'");
}

std::string FunctionName(const CommandFacts& command) {
  return absl::StrCat("_", absl::StrReplaceAll(command.name, {{" ", "_"}}));
}

// The lines that list the commands below `command` and hand over to the one that was chosen.
std::string Dispatch(const CommandFacts& command) {
  std::string lists, cases;
  for (const CommandFacts& below : command.commands) {
    absl::StrAppend(&lists, "        '", Escape(below.word()), ":",
                    absl::StrReplaceAll(below.text, {{"'", "'\\''"}}), "'\n");
    absl::StrAppend(&cases, "        ", below.word(), ") ", FunctionName(below), " ;;\n");
  }
  return absl::StrCat("  case $state in\n    command)\n      local -a commands=(\n", lists,
                      "      )\n      _describe -t commands '", command.name,
                      " command' commands\n      ;;\n    rest)\n      case $line[1] in\n", cases,
                      "      esac\n      ;;\n  esac\n");
}

void AppendFunctions(const CommandFacts& command, std::string* script) {
  for (const CommandFacts& below : command.commands) AppendFunctions(below, script);
  std::vector<std::string> specs;
  for (const OptionFacts& option : command.flags()) specs.push_back(FlagSpec(option));
  int index = 0;
  for (const OptionFacts& option : command.positionals()) specs.push_back(PositionalSpec(option, ++index));
  const bool commands = !command.commands.empty();
  if (commands) {
    specs.push_back("'1:command:->command'");
    specs.push_back("'*::argument:->rest'");
  }
  absl::StrAppend(script, FunctionName(command), "() {\n");
  if (commands)
    absl::StrAppend(script, "  local curcontext=$curcontext state state_descr line\n  typeset -A opt_args\n");
  absl::StrAppend(script, "  _arguments ", commands ? "-C " : "", "\\\n    ",
                  absl::StrJoin(specs, " \\\n    "), "\n");
  if (commands) absl::StrAppend(script, Dispatch(command));
  absl::StrAppend(script, "}\n\n");
}

}  // namespace

std::string ZshCompletion(const CommandFacts& program) {
  std::string script = absl::StrCat("#compdef ", program.name, "\n# Completion of ", program.name,
                                    " in zsh; it comes from the program itself.\n\n");
  AppendFunctions(program, &script);
  // Found in a folder of fpath, the file is the body of the function itself; sourced, it declares it.
  return absl::StrCat(script, "if [[ $funcstack[1] == _", program.name, " ]]; then\n  _", program.name,
                      " \"$@\"\nelse\n  compdef _", program.name, " ", program.name, "\nfi\n");
}

}  // namespace dbr
