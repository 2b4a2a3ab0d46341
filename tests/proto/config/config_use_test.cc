// Tests that every field of the config is read: its accessor is called in the sources of the folders that it
// is for. (tests/learner/algorithms/config_effect_test.cc tests more for the algorithms' fields: that they
// have an effect.)
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "proto/config.pb.h"

namespace dbr {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

// The folders that read a message's fields. The learner reads an algorithm's message unless it is listed
// here.
const std::map<std::string, std::vector<std::string>>& Readers() {
  static const auto* const readers = new std::map<std::string, std::vector<std::string>>{
      {"Config", {"actor", "learner", "replay", "deploy"}},
      {"EnvConfig", {"envs", "actor", "learner", "replay", "deploy"}},
      {"NetworkConfig", {"learner", "nn", "proto"}},
      {"AlgorithmConfig", {"actor", "learner", "replay"}},
      {"DbrConfig", {"learner", "replay"}},
      {"ReplayConfig", {"replay"}},
      {"SeedBufferConfig", {"replay"}},
      {"LearnerConfig", {"learner", "deploy"}},
      {"ActorConfig", {"actor", "deploy"}},
      {"EvaluationConfig", {"actor", "deploy"}},
      {"LaunchConfig", {"deploy"}},
  };
  return *readers;
}

// Returns the code of a folder in one string, without comments.
const std::string& CodeOf(const std::string& folder) {
  static auto* const cache = new std::map<std::string, std::string>;
  std::string& code = (*cache)[folder];
  if (!code.empty()) return code;
  const std::filesystem::path root = DBR_SOURCE_DIR;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
    if (entry.path().extension() != ".h" && entry.path().extension() != ".cc") continue;
    std::ifstream stream(entry.path());
    for (std::string line; std::getline(stream, line);) code += line.substr(0, line.find("//")) + "\n";
  }
  return code;
}

bool IsRead(const std::string& code, const FieldDescriptor& field) {
  const std::string name = field.lowercase_name();
  for (const std::string& call : {name + "(", "has_" + name + "(", name + "_size("}) {
    if (code.find("." + call) != std::string::npos || code.find("->" + call) != std::string::npos)
      return true;
  }
  return false;
}

std::vector<std::string> FoldersFor(const Descriptor& message) {
  const auto found = Readers().find(message.name());
  return found != Readers().end() ? found->second : std::vector<std::string>{"learner"};
}

// Calls `visit(message, field)` for every field of `message` and of the messages within it. Visits each
// message once.
template <class Visit>
void WalkFields(const Descriptor& message, std::map<std::string, bool>* seen, const Visit& visit) {
  if (std::exchange((*seen)[message.full_name()], true)) return;
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      WalkFields(*field.message_type(), seen, visit);
    } else {
      visit(message, field);
    }
  }
}

TEST(ConfigUseTest, EveryFieldIsReadInTheRoomsThatItIsFor) {
  std::map<std::string, bool> seen;
  int fields = 0;
  WalkFields(*Config::descriptor(), &seen, [&](const Descriptor& message, const FieldDescriptor& field) {
    ++fields;
    bool read = false;
    for (const std::string& folder : FoldersFor(message)) read = read || IsRead(CodeOf(folder), field);
    EXPECT_TRUE(read) << message.name() << "." << field.name() << " is read nowhere";
  });
  EXPECT_GT(fields, 60);
}

TEST(ConfigUseTest, FindsAFieldThatNothingReads) {
  const FieldDescriptor& field = *EnvConfig::descriptor()->FindFieldByName("name");
  EXPECT_TRUE(IsRead("x = config.env().name();", field));
  EXPECT_TRUE(IsRead("x = env->name();", field));
  EXPECT_FALSE(IsRead("x = config.set_name(y); z = name(); config.surname();", field));
  EXPECT_TRUE(IsRead("config.opponents_size()", *EnvConfig::descriptor()->FindFieldByName("opponents")));
}

TEST(ConfigUseTest, ACommentIsNoReader) {
  EXPECT_EQ(CodeOf("core").find("// "), std::string::npos);
  EXPECT_GT(CodeOf("learner").size(), 10000u);
}

}  // namespace
}  // namespace dbr
