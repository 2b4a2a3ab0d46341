// A CLI::App read as plain values.
#include "deploy/manual/command_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/deploy/manual/small_program.h"

namespace dbr {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

OptionFacts Find(const CommandFacts& command, const std::string& name) {
  for (const OptionFacts& option : command.options) {
    if (option.positional == name || (!option.names.empty() && option.names.back() == name)) return option;
  }
  ADD_FAILURE() << "no " << name << " in " << command.name;
  return {};
}

class CommandTreeTest : public testing::Test {
 protected:
  const SmallProgram small_;
  const CommandFacts program_ = ReadCommands(small_.app);
};

TEST_F(CommandTreeTest, HasEachCommandWithItsWholeName) {
  EXPECT_EQ(program_.name, "tool");
  ASSERT_EQ(program_.commands.size(), 2);
  EXPECT_EQ(program_.commands[0].name, "tool run");
  ASSERT_EQ(program_.commands[1].commands.size(), 2);
  EXPECT_EQ(program_.commands[1].commands[0].name, "tool data record");
  EXPECT_EQ(program_.commands[1].commands[0].word(), "record");
}

TEST_F(CommandTreeTest, TellsPositionalsFlagsAndHiddenOptionsApart) {
  const CommandFacts& run = program_.commands[0];
  ASSERT_EQ(run.positionals().size(), 1);
  EXPECT_EQ(run.positionals()[0].positional, "CONFIG");
  std::vector<std::string> names;
  for (const OptionFacts& option : run.flags()) names.push_back(option.names.back());
  EXPECT_THAT(names, ElementsAre("--help", "--set", "--mode", "--jobs", "--run-dir", "--dry-run"));
}

TEST_F(CommandTreeTest, ReadsWhatAnOptionTakesFromItsTypeName) {
  const CommandFacts& run = program_.commands[0];
  EXPECT_EQ(Find(run, "CONFIG").kind(), ValueKind::kFile);
  EXPECT_EQ(Find(run, "--run-dir").kind(), ValueKind::kFolder);
  EXPECT_EQ(Find(run, "--set").kind(), ValueKind::kOther);
  EXPECT_EQ(Find(run, "--dry-run").kind(), ValueKind::kNone);
  EXPECT_EQ(Find(run, "--mode").kind(), ValueKind::kChoice);
  EXPECT_THAT(Find(run, "--mode").choices(), ElementsAre("fast", "slow"));
  EXPECT_THAT(Find(run, "--set").choices(), IsEmpty());
  OptionFacts policy;
  policy.value = "FILE_OR_RUN";
  EXPECT_EQ(policy.kind(), ValueKind::kFile);
}

TEST_F(CommandTreeTest, KeepsBoundsDefaultsAndWhatMustBeGiven) {
  const CommandFacts& run = program_.commands[0];
  EXPECT_EQ(Find(run, "--jobs").value, "N");
  EXPECT_EQ(Find(run, "--jobs").bounds, "INT in [1 - 9]");
  EXPECT_THAT(Find(run, "--jobs").names, ElementsAre("-j", "--jobs"));
  EXPECT_EQ(Find(run, "--mode").value, "fast|slow|steps:N");
  EXPECT_EQ(Find(run, "--mode").default_value, "fast");
  EXPECT_TRUE(Find(run, "--set").repeated);
  EXPECT_FALSE(Find(run, "--jobs").repeated);
  EXPECT_TRUE(Find(run, "--run-dir").required);
  EXPECT_TRUE(Find(program_.commands[1].commands[1], "FILES").repeated);
}

}  // namespace
}  // namespace dbr
