#include <functional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "deploy/manual/completion.h"

namespace dbr {
namespace {

// %s: the program. `kind` is what the word under the cursor may be, and `words` are the choices.
constexpr char kBegin[] = R"(() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}
  local kind=choice words="" flags="" word i
  COMPREPLY=()
  # Bash makes three words of --option=value.
  if [[ $current == "=" ]]; then
    current=""
  elif [[ $previous == "=" ]]; then
    previous=${COMP_WORDS[COMP_CWORD-2]}
  fi
)";

constexpr char kEnd[] = R"(  if [[ $current == -* && $flags ]]; then
    kind=choice words=$flags
  fi
  case "$kind" in
    file) compopt -o filenames -o default 2> /dev/null; mapfile -t COMPREPLY < <(compgen -f -- "$current") ;;
    folder) compopt -o filenames -o dirnames 2> /dev/null; mapfile -t COMPREPLY < <(compgen -d -- "$current") ;;
    choice) mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current") ;;
  esac
}
)";

void Visit(const CommandFacts& command, const std::function<void(const CommandFacts&)>& visit) {
  visit(command);
  for (const CommandFacts& below : command.commands) Visit(below, visit);
}

// The assignments that say what completes a value.
std::string Completes(const OptionFacts& option) {
  switch (option.kind()) {
    case ValueKind::kFile:
      return "kind=file";
    case ValueKind::kFolder:
      return "kind=folder";
    case ValueKind::kChoice:
      return absl::StrCat("words=\"", absl::StrJoin(option.choices(), " "), "\"");
    default:
      return "kind=other";
  }
}

// The words before the cursor that name commands: a case for all of them, tried in turn.
std::string FindCommand(const CommandFacts& program) {
  std::vector<std::string> names;
  Visit(program, [&](const CommandFacts& command) {
    if (command.name != program.name) names.push_back(absl::StrCat("\"", command.name, "\""));
  });
  std::string text = absl::StrCat("  local command=\"", program.name, "\"\n");
  if (names.empty()) return text;
  absl::StrAppend(&text, "  for ((i = 1; i < COMP_CWORD; i++)); do\n    word=${COMP_WORDS[i]}\n",
                  "    case \"$command $word\" in\n      ", absl::StrJoin(names, " | "),
                  ") command+=\" $word\" ;;\n    esac\n  done\n");
  return text;
}

// What may stand at the cursor where it's not the value of an option.
std::string Operands(const CommandFacts& command) {
  std::vector<std::string> names, words;
  for (const OptionFacts& flag : command.flags())
    names.insert(names.end(), flag.names.begin(), flag.names.end());
  for (const CommandFacts& below : command.commands) words.push_back(below.word());
  std::string text =
      absl::StrCat("        \"", command.name, "\") flags=\"", absl::StrJoin(names, " "), "\"");
  const std::vector<OptionFacts> positionals = command.positionals();
  if (!words.empty()) {
    absl::StrAppend(&text, " words=\"", absl::StrJoin(words, " "), "\"");
  } else if (!positionals.empty()) {
    absl::StrAppend(&text, " ", Completes(positionals[0]));
  } else {
    absl::StrAppend(&text, " words=$flags");
  }
  return absl::StrCat(text, " ;;\n");
}

}  // namespace

std::string BashCompletion(const CommandFacts& program) {
  std::string values, operands;
  Visit(program, [&](const CommandFacts& command) {
    for (const OptionFacts& option : command.flags()) {
      for (const std::string& name : option.names) {
        if (option.kind() == ValueKind::kNone) continue;
        absl::StrAppend(&values, "    \"", command.name, " ", name, "\") ", Completes(option), " ;;\n");
      }
    }
    absl::StrAppend(&operands, Operands(command));
  });
  return absl::StrCat("# Completion of ", program.name, " in bash; it comes from the program itself.\n_",
                      program.name, kBegin, FindCommand(program), "  case \"$command $previous\" in\n",
                      values, "    *)\n      case \"$command\" in\n", operands,
                      "      esac\n      ;;\n  esac\n", kEnd, "complete -F _", program.name, " ",
                      program.name, "\n");
}

}  // namespace dbr
