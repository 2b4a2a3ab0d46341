// What the tests read of our Markdown pages.
#pragma once

#include <string>
#include <vector>

namespace dbr {

// A block between two lines that begin with ```.
struct Fence {
  int line = 0;                    // of its first ```, counted from 1
  std::vector<std::string> words;  // behind the first ```: {"sh", "test", ...}
  std::string text;                // with its line breaks, without the ``` lines

  bool IsShell() const { return !words.empty() && words[0] == "sh"; }
  // "```sh test FILE...": the commands are run as they stand, and then these files must be there.
  bool IsRun() const { return IsShell() && words.size() > 1 && words[1] == "test"; }
  std::vector<std::string> PromisedFiles() const;  // of one that is run
};

std::vector<Fence> Fences(const std::string& page);

// The page with its fenced blocks left out, each line in its place.
std::string Prose(const std::string& page);

// Targets of links and pictures, [words](target), outside of fenced blocks.
std::vector<std::string> LinkTargets(const std::string& page);

// What a link to a heading says behind its '#', as GitHub makes it: "## Exit codes" is "exit-codes".
std::vector<std::string> Anchors(const std::string& page);

// What stands between backticks in headings: "## `message`".
std::vector<std::string> QuotedInHeadings(const std::string& page);

// The commands of a shell block, one a line: lines that end in a backslash are joined, comments are left out.
std::vector<std::string> Commands(const std::string& shell);

}  // namespace dbr
