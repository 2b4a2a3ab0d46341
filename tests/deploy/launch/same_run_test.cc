// Which fields of a config count when runs are compared.
#include "deploy/launch/same_run.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "deploy/report/settings.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Gives a field that is not a message another value than its default.
void SetAnother(const FieldDescriptor& field, Message* message) {
  const google::protobuf::Reflection& reflection = *message->GetReflection();
  if (field.is_repeated()) {
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_UINT32) return reflection.AddUInt32(message, &field, 9);
    return reflection.AddString(message, &field, "another");
  }
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_UINT32:
      return reflection.SetUInt32(message, &field, field.default_value_uint32() + 1);
    case FieldDescriptor::CPPTYPE_UINT64:
      return reflection.SetUInt64(message, &field, field.default_value_uint64() + 1);
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return reflection.SetDouble(message, &field, field.default_value_double() + 0.5);
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection.SetBool(message, &field, !field.default_value_bool());
    case FieldDescriptor::CPPTYPE_ENUM:
      return reflection.SetEnumValue(message, &field, field.default_value_enum()->number() == 0 ? 1 : 0);
    case FieldDescriptor::CPPTYPE_STRING:
      return reflection.SetString(message, &field, "another");
    default:
      FAIL() << field.full_name() << ": a type that this test does not know";
  }
}

// The fields of the message that `part` gives of a config, and of those within it, of which another value
// makes no other outcome.
void FindWithoutInfluence(const std::function<Message*(Config*)>& part, const std::string& path,
                          std::vector<std::string>* found) {
  Config plain;
  const google::protobuf::Descriptor& type = *part(&plain)->GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor* field = type.field(i);
    const std::string name = path + field->name();
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      const auto within = [part, field](Config* config) {
        Message* message = part(config);
        return message->GetReflection()->MutableMessage(message, field);
      };
      FindWithoutInfluence(within, name + ".", found);
      continue;
    }
    Config other = plain;
    SetAnother(*field, part(&other));
    const bool same = DifferencesOfOutcome(plain, other).empty();  // as dbr experiment asks
    if (same) found->push_back(name);
    // As dbr report asks, which leaves the seed out, for it averages over seeds.
    const report::Settings settings = report::SettingsOf(other), plain_settings = report::SettingsOf(plain);
    EXPECT_EQ(settings.digest == plain_settings.digest, same || name == "seed") << name;
    EXPECT_EQ(settings.differences == plain_settings.differences, same || name == "seed") << name;
  }
}

TEST(OutcomeTest, EveryFieldCountsButThese) {
  std::vector<std::string> without_influence;
  FindWithoutInfluence([](Config* config) { return config; }, "", &without_influence);
  EXPECT_THAT(without_influence,
              ElementsAre("algorithm.threads", "replay.address", "replay.allow_insecure",
                          "learner.checkpoint_every_s", "learner.keep_checkpoints", "learner.address",
                          "learner.allow_insecure", "launch.max_restarts", "launch.restart_window_s"));
}

TEST(OutcomeTest, AConfigIsComparedAsItTakesEffect) {
  Config written;
  written.mutable_algorithm()->mutable_dbr()->set_epsilon(0.05);  // the default
  EXPECT_EQ(DifferencesOfOutcome(Config(), written), "");
  EXPECT_TRUE(
      google::protobuf::util::MessageDifferencer::Equals(OutcomeConfig(Config()), WithDefaults(written)));
  EXPECT_EQ(report::SettingsOf(Config()).digest, report::SettingsOf(written).digest);
  written.mutable_algorithm()->mutable_dbr()->set_epsilon(0.1);
  EXPECT_THAT(DifferencesOfOutcome(Config(), written), HasSubstr("algorithm.dbr.epsilon: 0.05 -> 0.1"));
}

TEST(OutcomeTest, OfTheSeedBufferTheFilesNameCounts) {
  Config here, there;
  here.mutable_replay()->mutable_seed_buffer()->set_path("/here/hopper.hdf5");
  there.mutable_replay()->mutable_seed_buffer()->set_path("there/hopper.hdf5");
  EXPECT_EQ(DifferencesOfOutcome(here, there), "");
  EXPECT_EQ(report::SettingsOf(here).digest, report::SettingsOf(there).digest);
  there.mutable_replay()->mutable_seed_buffer()->set_path("/here/walker.hdf5");
  EXPECT_THAT(DifferencesOfOutcome(here, there), HasSubstr("\"hopper.hdf5\" -> \"walker.hdf5\""));
}

}  // namespace
}  // namespace dbr
