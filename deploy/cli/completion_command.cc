#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "deploy/cli/command_line.h"
#include "deploy/manual/completion.h"

namespace dbr {
namespace {

absl::StatusOr<std::string> Script(const std::string& shell, const CommandFacts& program) {
  if (shell == "bash") return BashCompletion(program);
  if (shell == "zsh") return ZshCompletion(program);
  if (shell == "fish") return FishCompletion(program);
  return absl::InvalidArgumentError(absl::StrCat("SHELL: expected bash, zsh or fish, found '", shell, "'"));
}

}  // namespace

void AddCompletion(CLI::App* app, int* exit_code) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = app->add_subcommand("completion", "Print a script that completes dbr in a shell");
  command->add_option("SHELL", *shell, "The shell that reads the script")
      ->required()
      ->type_name("bash|zsh|fish");
  command->footer(
      "An installed dbr needs none of this: the scripts are where the shells look for them.\n\n"
      "Examples:\n"
      "  source <(dbr completion bash)\n"
      "  source <(dbr completion zsh)\n"
      "  dbr completion fish | source");
  command->callback([app, shell, exit_code] {
    const absl::StatusOr<std::string> script = Script(*shell, ReadCommands(*app));
    *exit_code = script.ok() ? 0 : Fail("completion", script.status());
    if (script.ok()) std::fputs(script->c_str(), stdout);
  });
}

}  // namespace dbr
