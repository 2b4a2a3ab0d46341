// Scripts that have a shell complete a program's commands, options and values.
#pragma once

#include <string>

#include "deploy/manual/command_tree.h"

namespace dbr {

// Each gives the whole script, which the shell sources or finds by its name in a standard folder. A script
// completes the commands, the options of the command that is being typed, and values: files, folders and
// choices (OptionFacts::kind). It runs no program.
std::string BashCompletion(const CommandFacts& program);  // bash-completion/completions/PROGRAM
std::string ZshCompletion(const CommandFacts& program);   // zsh/site-functions/_PROGRAM
std::string FishCompletion(const CommandFacts& program);  // fish/vendor_completions.d/PROGRAM.fish

}  // namespace dbr
