// docs/troubleshooting.md quotes messages of our programs: each of them must still be one.
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "tests/docs/markdown.h"
#include "tests/docs/pages.h"

namespace dbr {
namespace {

// A source in which texts that go on in the next line are one, as the compiler sees them. What stands in two
// arguments side by side, "a", "b", becomes one text too.
std::string WithTextsJoined(const std::string& source) {
  static const std::regex kSeam("\"\\s*,?\\s*\"");
  const std::string marked =
      absl::StrReplaceAll(source, {{"\\\"", "\x01"}});  // so that no seam begins at a quoted "
  return absl::StrReplaceAll(std::regex_replace(marked, kSeam, ""), {{"\x01", "\""}});
}

std::vector<std::string> Sources() {
  std::vector<std::string> sources;
  for (const char* folder : {"core", "proto", "nn", "envs", "replay", "learner", "actor", "deploy"}) {
    for (const std::string& path : FilesBelow(folder, {".cc", ".h"}))
      sources.push_back(WithTextsJoined(ReadPage(path)));
  }
  return sources;
}

// The constant pieces of a quoted message, in which "…" stands for what differs from case to case.
std::vector<std::string> Pieces(const std::string& message) {
  return absl::StrSplit(message, "…", absl::SkipWhitespace());
}

TEST(TroubleshootingTest, EachQuotedMessageStandsInOneSource) {
  const std::vector<std::string> sources = Sources();
  const std::vector<std::string> messages = QuotedInHeadings(ReadPage("docs/troubleshooting.md"));
  EXPECT_GE(messages.size(), 20u);
  for (const std::string& message : messages) {
    const std::vector<std::string> pieces = Pieces(message);
    EXPECT_FALSE(pieces.empty()) << message;
    const auto has_all = [&](const std::string& source) {
      return std::all_of(pieces.begin(), pieces.end(),
                         [&](const std::string& piece) { return absl::StrContains(source, piece); });
    };
    EXPECT_TRUE(std::any_of(sources.begin(), sources.end(), has_all))
        << "docs/troubleshooting.md quotes a message that no source has: " << message;
  }
}

TEST(TroubleshootingTest, ATextOverSeveralLinesIsFound) {
  EXPECT_EQ(WithTextsJoined("Error(\"one \"\n    \"text, \\\"quoted\\\"\")"),
            "Error(\"one text, \"quoted\"\")");
}

}  // namespace
}  // namespace dbr
