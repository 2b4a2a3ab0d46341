// The commands in our pages. In README.md and docs/tutorial.md the blocks that begin with "```sh test" are
// run as they stand, in the page's order; the files named behind "test" must be there when the page is
// through. In all pages the other commands of dbr are looked up: subcommand, flags, and the files of deploy
// that they name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tests/docs/markdown.h"
#include "tests/docs/pages.h"
#include "tests/docs/working_folder.h"

namespace dbr {
namespace {

constexpr int kPatienceS = 270;  // below the test's own timeout

// The marked blocks of a page as one script. Each line says where it came from, so that a failure does too.
std::string ScriptOf(const std::string& path, const std::vector<Fence>& fences) {
  std::string script = "set -euo pipefail\n";
  for (const Fence& fence : fences) {
    if (fence.IsRun()) absl::StrAppend(&script, "echo '== ", path, ":", fence.line, "'\n", fence.text);
  }
  return absl::StrCat(script, "for job in $(jobs -p); do wait \"$job\"; done\n");
}

void ExpectRunsAsWritten(const std::string& path) {
  const std::vector<Fence> fences = Fences(ReadPage(path));
  const WorkingFolder folder;
  const auto [status, output] = folder.Run(ScriptOf(path, fences), kPatienceS);
  EXPECT_EQ(status, 0) << output;
  int run = 0;
  for (const Fence& fence : fences) {
    run += fence.IsRun();
    for (const std::string& file : fence.PromisedFiles())
      EXPECT_TRUE(folder.Holds(file)) << path << ":" << fence.line << " promises " << file << "\n" << output;
  }
  EXPECT_GT(run, 0) << path << " has no block that begins with ```sh test";
}

TEST(CommandsTest, ThoseOfTheReadmeRunAsWritten) {
  ExpectRunsAsWritten("README.md");
}

TEST(CommandsTest, ThoseOfTheTutorialRunAsWritten) {
  ExpectRunsAsWritten("docs/tutorial.md");
}

// A command of dbr, by what its --help is asked for.
struct Called {
  std::string program;     // dbr, or dbr-replay, ...
  std::string subcommand;  // "launch", "dataset record"
  std::vector<std::string> flags, files;
};

bool EndsACommand(const std::string& word) {
  return word == "&" || word == "&&" || word == "|" || absl::StartsWith(word, ">") ||
         absl::StartsWith(word, "2>");
}

Called Parse(const std::string& command) {
  std::vector<std::string> words = absl::StrSplit(command, ' ', absl::SkipEmpty());
  Called called;
  called.program = std::filesystem::path(words[0]).filename();
  std::size_t next = 1;
  if (called.program == "dbr" && words.size() > 1 && !absl::StartsWith(words[1], "-")) {
    called.subcommand = words[next++];
    if (called.subcommand == "dataset" && words.size() > next)
      absl::StrAppend(&called.subcommand, " ", words[next++]);
  }
  for (; next < words.size() && !EndsACommand(words[next]); ++next) {
    if (absl::StartsWith(words[next], "--"))
      called.flags.push_back(words[next].substr(0, words[next].find('=')));
    else if (absl::StartsWith(words[next], "deploy/"))
      called.files.push_back(words[next]);
  }
  return called;
}

// What --help says; asked once for each subcommand.
const std::string& HelpOf(const Called& called) {
  static std::map<std::string, std::string> answers;
  const std::string command = absl::StrCat("build/bin/", called.program, " ", called.subcommand, " --help");
  std::string& answer = answers[command];
  if (answer.empty()) answer = WorkingFolder().Run(command, kPatienceS).second;
  return answer;
}

bool KnowsFlag(const std::string& help, const std::string& flag) {
  return absl::StrContains(help, absl::StrCat(" ", flag, " ")) ||
         absl::StrContains(help, absl::StrCat(",", flag, " "));
}

// `build/bin/dbr ...` or the like; dbr-bench is Google Benchmark's.
bool IsOurs(const std::string& command) {
  return absl::StartsWith(command, "build/bin/dbr") && !absl::StartsWith(command, "build/bin/dbr-bench");
}

void ExpectIsKnown(const std::string& command, const std::string& where) {
  const Called called = Parse(command);
  const std::string& help = HelpOf(called);
  const std::string usage =
      absl::StrCat(called.program, called.subcommand.empty() ? "" : " ", called.subcommand, " [OPTIONS]");
  EXPECT_TRUE(absl::StrContains(help, usage)) << where << ": there is no such command: " << command;
  for (const std::string& flag : called.flags)
    EXPECT_TRUE(KnowsFlag(help, flag)) << where << ": there is no flag " << flag << ": " << command;
  for (const std::string& file : called.files)
    EXPECT_TRUE(std::filesystem::exists(InTree(file))) << where << ": there is no " << file;
}

// cmake --preset NAME, as often as it stands in the command.
void ExpectPresetsExist(const std::string& command, const std::string& where) {
  const std::vector<std::string> words = absl::StrSplit(command, ' ', absl::SkipEmpty());
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    if (words[i] != "--preset") continue;
    EXPECT_TRUE(absl::StrContains(ReadPage("CMakePresets.json"), absl::StrCat("\"", words[i + 1], "\"")))
        << where << ": there is no preset " << words[i + 1];
  }
}

TEST(CommandsTest, SubcommandsFlagsAndFilesOfAllPagesExist) {
  for (const std::string& page : AllPages()) {
    for (const Fence& fence : Fences(ReadPage(page))) {
      const std::string where = absl::StrCat(page, ":", fence.line);
      for (const std::string& command : Commands(fence.text)) {
        if (absl::StartsWith(command, "deploy/")) {
          const std::string script = command.substr(0, command.find(' '));
          EXPECT_TRUE(std::filesystem::exists(InTree(script))) << where << ": there is no " << script;
        }
        if (absl::StartsWith(command, "cmake ")) ExpectPresetsExist(command, where);
        if (!IsOurs(command)) continue;
        EXPECT_TRUE(fence.IsShell()) << where << ": expected ```sh before commands";
        ExpectIsKnown(command, where);
      }
    }
  }
}

// A link is PATH, PATH#HEADING or #HEADING.
void ExpectLeadsSomewhere(const std::string& target, const std::string& page) {
  const std::pair<std::string, std::string> link = absl::StrSplit(target, absl::MaxSplits('#', 1));
  const std::filesystem::path folder = std::filesystem::path(page).parent_path();
  const std::string path = link.first.empty() ? page : (folder / link.first).lexically_normal().string();
  EXPECT_TRUE(std::filesystem::exists(InTree(path)))
      << page << " links to " << target << ", which is not there";
  if (!link.second.empty() && absl::EndsWith(path, ".md")) {
    EXPECT_THAT(Anchors(ReadPage(path)), testing::Contains(link.second))
        << page << " links to a heading that is not there";
  }
}

TEST(PagesTest, LinksLeadToFilesAndHeadingsOfTheTree) {
  for (const std::string& page : AllPages()) {
    for (const std::string& target : LinkTargets(ReadPage(page)))
      if (!absl::StrContains(target, "://")) ExpectLeadsSomewhere(target, page);
  }
}

}  // namespace
}  // namespace dbr
