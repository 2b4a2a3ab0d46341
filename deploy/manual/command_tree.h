// A program's commands and options as plain values, which manual pages and shell completion are made from.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace dbr {

// What may stand where an option or a positional argument expects a value.
enum class ValueKind { kNone, kFile, kFolder, kChoice, kOther };

// An option ("--seed N"), a flag ("--json") or a positional argument ("CONFIG").
struct OptionFacts {
  std::vector<std::string> names;  // {"-h", "--help"}; empty for a positional argument
  std::string positional;          // the name of a positional argument, else ""
  std::string value;               // what it takes, "N", "FILE" or "d4rl|minari"; "" for a flag
  std::string bounds;              // what a validator says of the value, "INT in [1 - 1024]"; often ""
  std::string default_value;       // "" where there is none, or where it is not shown
  std::string text;                // one line of help
  bool required = false;
  bool repeated = false;

  // The type name of the option decides. Names joined by "|" are choices; FILE and what ends in _OR_RUN are
  // files (or the folder of a run); DIR is a folder.
  ValueKind kind() const;
  // The choices that can be typed as they stand: "mcts:N" is a pattern and is left out.
  std::vector<std::string> choices() const;
};

// A program or one of its commands.
struct CommandFacts {
  std::string name;  // all words: "dbr dataset record"
  std::string text;  // one line of help
  std::string footer;
  std::vector<OptionFacts> options;  // in the order of their declaration, positional arguments among them
  std::vector<CommandFacts> commands;

  // The last word of the name.
  std::string word() const;
  std::vector<OptionFacts> positionals() const;
  // All that begin with a dash.
  std::vector<OptionFacts> flags() const;
};

// The program or command `app` with all below it. Hidden options (those of the group "") are left out.
CommandFacts ReadCommands(const CLI::App& app);

}  // namespace dbr
