#include "core/json_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"

namespace dbr {
namespace {

using testing::HasSubstr;

std::string Nested(int depth, const std::string& open, const std::string& close) {
  std::string text;
  for (int i = 0; i < depth; ++i) text += open;
  for (int i = 0; i < depth; ++i) text += close;
  return text;
}

TEST(JsonTextTest, ReadsWhatIsJson) {
  EXPECT_EQ(ParseJson(R"({"a": [1, "x"]})").value()["a"][1], "x");
  EXPECT_TRUE(ParseJson(Nested(kMostJsonDepth, "[", "]")).ok());
  const std::string opened = Nested(kMostJsonDepth, "{\"a\":", ""), closed = Nested(kMostJsonDepth, "", "}");
  EXPECT_TRUE(ParseJson(absl::StrCat(opened, "1", closed)).ok());
}

TEST(JsonTextTest, BracketsInTextsAreNoDepth) {
  const std::string brackets(1000, '[');
  EXPECT_EQ(ParseJson("[\"\\\"" + brackets + "\\\\\", \"" + brackets + "\"]").value()[1], brackets);
}

TEST(JsonTextTest, ManyListsBesideEachOtherAreNoDepth) {
  std::string text = "[";
  for (int i = 0; i < 1000; ++i) text += "[[]],";
  EXPECT_EQ(ParseJson(text + "0]").value().size(), 1001u);
}

// Text that is no JSON is refused either way; what matters is that the stack lasts.
TEST(JsonTextTest, DeepNestingIsRefused) {
  for (const std::string& text :
       {Nested(100000, "[", "]"), Nested(100000, "{\"a\":", "}"), std::string(100000, '['),
        Nested(kMostJsonDepth + 1, "[", "]"), absl::StrCat("\"\"", std::string(100000, '{'))}) {
    const absl::Status status = ParseJson(text).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), HasSubstr("more than 64 deep"));
  }
}

TEST(JsonTextTest, OtherTextIsRefused) {
  for (const char* text : {"", "no json", "{", "]", "[1,]", "\"", "\"\\", "{} {}"})
    EXPECT_THAT(std::string(ParseJson(text).status().message()), HasSubstr("no JSON")) << text;
}

TEST(JsonTextTest, AHugeTextIsRefusedUnread) {
  const std::string text(kMostJsonBytes + 1, ' ');
  EXPECT_THAT(std::string(ParseJson(text).status().message()), HasSubstr("bytes of JSON, of which at most"));
}

}  // namespace
}  // namespace dbr
