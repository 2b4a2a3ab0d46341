// Completion scripts: bash's is run, the others' are read.
#include "deploy/manual/completion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "tests/deploy/manual/small_program.h"
#include "tests/integration/dbr_process.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

class BashCompletionTest : public testing::Test {
 protected:
  BashCompletionTest() {
    EXPECT_TRUE(WriteFileAtomically(script_, BashCompletion(ReadCommands(SmallProgram().app))).ok());
  }

  // What bash offers at the end of the words after "tool"; the last one is the word that is being typed.
  std::vector<std::string> Complete(const std::vector<std::string>& words) const {
    const std::string commands =
        absl::StrCat("set -u; source ", script_, "; COMP_WORDS=(tool \"$@\"); COMP_CWORD=$#; _tool; ",
                     "((${#COMPREPLY[@]} == 0)) || printf '%s\\n' \"${COMPREPLY[@]}\"");
    std::vector<std::string> arguments = {"--norc", "-c", commands, "bash"};
    arguments.insert(arguments.end(), words.begin(), words.end());
    const auto [status, output] = RunProgram("/bin/bash", arguments);
    EXPECT_EQ(status, 0) << output;
    return absl::StrSplit(output, '\n', absl::SkipEmpty());
  }

  const TempDir folder_;
  const std::string script_ = folder_ / "completion";
};

TEST_F(BashCompletionTest, OffersCommandsOnTheirLevel) {
  EXPECT_THAT(Complete({""}), UnorderedElementsAre("run", "data"));
  EXPECT_THAT(Complete({"da"}), UnorderedElementsAre("data"));
  EXPECT_THAT(Complete({"data", ""}), UnorderedElementsAre("record", "info"));
}

TEST_F(BashCompletionTest, OffersTheOptionsOfTheCommand) {
  EXPECT_THAT(Complete({"-"}), UnorderedElementsAre("-h", "--help"));
  EXPECT_THAT(Complete({"run", "--r"}), UnorderedElementsAre("--run-dir"));
  EXPECT_THAT(Complete({"run", "-"}), IsSupersetOf({"--jobs", "-j", "--dry-run"}));
  EXPECT_THAT(Complete({"data", "record", "--"}), UnorderedElementsAre("--help", "--env"));
  EXPECT_THAT(Complete({"data", "record", ""}), UnorderedElementsAre("-h", "--help", "--env"));
}

TEST_F(BashCompletionTest, OffersValues) {
  EXPECT_THAT(Complete({"run", "--mode", ""}), UnorderedElementsAre("fast", "slow"));
  EXPECT_THAT(Complete({"run", "--mode", "=", "s"}), UnorderedElementsAre("slow"));
  EXPECT_THAT(Complete({"run", "--mode", "="}), UnorderedElementsAre("fast", "slow"));
  EXPECT_THAT(Complete({"run", "--jobs", ""}), IsEmpty());
}

TEST_F(BashCompletionTest, OffersFilesAndFolders) {
  ASSERT_TRUE(std::filesystem::create_directory(folder_ / "a folder"));
  ASSERT_TRUE(WriteFileAtomically(folder_ / "a file", "").ok());
  EXPECT_THAT(Complete({"run", folder_ / "a"}),
              UnorderedElementsAre(folder_ / "a file", folder_ / "a folder"));
  EXPECT_THAT(Complete({"run", "--run-dir", folder_ / "a"}), UnorderedElementsAre(folder_ / "a folder"));
  EXPECT_THAT(Complete({"data", "info", folder_ / "a f"}),
              UnorderedElementsAre(folder_ / "a file", folder_ / "a folder"));
}

TEST(ZshCompletionTest, DescribesOptionsAndHandsOverToCommands) {
  const std::string script = ZshCompletion(ReadCommands(SmallProgram().app));
  EXPECT_THAT(script,
              AllOf(HasSubstr("#compdef tool\n"), HasSubstr("'run:Run it [now]: isn'\\''t this easy?'"),
                    HasSubstr("'*--set=[Override a field]:PATH=VALUE: '"),
                    HasSubstr("'--mode=[How it acts]:fast|slow|steps\\:N:(fast slow)'"),
                    HasSubstr("'(-j --jobs)'{-j+,--jobs=}'[How many at once]:N: '"),
                    HasSubstr("'--run-dir=[Folder of the run]:DIR:_files -/'"),
                    HasSubstr("'1::CONFIG:_files'"), HasSubstr("'*:FILES:_files'"),
                    HasSubstr("record) _tool_data_record ;;"), Not(HasSubstr("secret"))));
}

TEST(FishCompletionTest, ConditionsEachOptionOnItsCommand) {
  const std::string script = FishCompletion(ReadCommands(SmallProgram().app));
  EXPECT_THAT(
      script,
      AllOf(
          HasSubstr("complete -c tool -n 'not __fish_seen_subcommand_from run data' -a run -d 'Run it [now]: "
                    "isn\\'t this easy?'\n"),
          HasSubstr("complete -c tool -n '__fish_seen_subcommand_from run' -l mode -x -a 'fast slow' -d "),
          HasSubstr("complete -c tool -n '__fish_seen_subcommand_from run' -r -F\n"),
          HasSubstr(
              "-n '__fish_seen_subcommand_from data; and __fish_seen_subcommand_from record' -l env -x"),
          HasSubstr("-n '__fish_seen_subcommand_from data; and not __fish_seen_subcommand_from record info' "
                    "-a info"),
          Not(HasSubstr("secret"))));
}

}  // namespace
}  // namespace dbr
