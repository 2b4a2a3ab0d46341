#include "tests/docs/markdown.h"

#include <algorithm>
#include <regex>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"

namespace dbr {
namespace {

constexpr char kFence[] = "```";

std::vector<std::string> Lines(const std::string& text) {
  return absl::StrSplit(text, '\n');
}

// What the first group of `pattern` finds, in order.
std::vector<std::string> FirstGroups(const std::string& text, const std::regex& pattern) {
  std::vector<std::string> found;
  for (std::sregex_iterator match(text.begin(), text.end(), pattern), end; match != end; ++match)
    found.push_back((*match)[1]);
  return found;
}

std::string WithoutIndent(const std::string& line) {
  return std::string(absl::StripLeadingAsciiWhitespace(line));
}

// The line up to a " #" or a "#" at its start.
std::string WithoutComment(const std::string& line) {
  if (absl::StartsWith(line, "#")) return "";
  return line.substr(0, line.find(" #"));
}

// Blocks within a list are indented.
bool IsFenceLine(const std::string& line) {
  return absl::StartsWith(WithoutIndent(line), kFence);
}

}  // namespace

std::vector<std::string> Fence::PromisedFiles() const {
  if (!IsRun()) return {};
  return {words.begin() + 2, words.end()};
}

std::vector<Fence> Fences(const std::string& page) {
  std::vector<Fence> fences;
  bool inside = false;
  int number = 0;
  for (const std::string& line : Lines(page)) {
    ++number;
    if (IsFenceLine(line)) {
      if (!inside) {
        const std::string info = WithoutIndent(line).substr(sizeof kFence - 1);
        fences.push_back({number, absl::StrSplit(info, ' ', absl::SkipEmpty()), ""});
      }
      inside = !inside;
    } else if (inside) {
      absl::StrAppend(&fences.back().text, line, "\n");
    }
  }
  return fences;
}

std::string Prose(const std::string& page) {
  std::vector<std::string> lines = Lines(page);
  bool inside = false;
  for (std::string& line : lines) {
    const bool fence = IsFenceLine(line);
    if (fence) inside = !inside;
    if (fence || inside) line.clear();
  }
  return absl::StrJoin(lines, "\n");
}

std::vector<std::string> LinkTargets(const std::string& page) {
  return FirstGroups(Prose(page), std::regex(R"(\]\(([^)\s]+)\))"));
}

std::vector<std::string> Anchors(const std::string& page) {
  std::vector<std::string> anchors;
  for (const std::string& line : Lines(Prose(page))) {
    if (!absl::StartsWith(line, "#")) continue;
    std::string anchor;
    for (const char c : line.substr(std::min(line.size(), line.find_first_not_of("# ")))) {
      if (absl::ascii_isalnum(c) || c == '-' || c == '_') anchor.push_back(absl::ascii_tolower(c));
      if (c == ' ') anchor.push_back('-');
    }
    anchors.push_back(anchor);
  }
  return anchors;
}

std::vector<std::string> QuotedInHeadings(const std::string& page) {
  std::vector<std::string> quoted;
  for (const std::string& line : Lines(Prose(page))) {
    if (!absl::StartsWith(line, "#")) continue;
    for (std::string& words : FirstGroups(line, std::regex("`([^`]+)`"))) quoted.push_back(std::move(words));
  }
  return quoted;
}

std::vector<std::string> Commands(const std::string& shell) {
  const std::string joined = absl::StrReplaceAll(shell, {{"\\\n", " "}});
  std::vector<std::string> commands;
  for (const std::string& line : Lines(joined)) {
    const std::string command = WithoutComment(WithoutIndent(line));
    if (!command.empty()) commands.push_back(command);
  }
  return commands;
}

}  // namespace dbr
