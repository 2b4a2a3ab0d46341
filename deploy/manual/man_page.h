// A program's manual pages, made from its command line.
#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "deploy/manual/command_tree.h"

namespace dbr {

struct ManPage {
  std::string file;  // "dbr-dataset-record.1"
  std::string text;  // in the man macros of troff, ASCII
};

// A page for the program and one for each command below it, in section 1. `version` stands in the foot of
// each page. A footer is divided by its lines: "Exit status: ..." and "Example: ..." or "Examples:" with the
// lines that follow become sections of their own, and everything else is the description.
std::vector<ManPage> MakeManPages(const CommandFacts& program, absl::string_view version);

// Gives `app`, the whole program, the hidden option --man-pages DIR. It writes the pages into the folder,
// which is made if need be, and ends the parsing with CLI::Success, or with CLI::FileError where a page could
// not be written. The installation calls each program so.
void AddManPagesOption(CLI::App* app);

}  // namespace dbr
