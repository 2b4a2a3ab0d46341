// An installed dbr, used from a folder that knows nothing of the sources.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/integration/dbr_process.h"
#include "tests/integration/run_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// Installed once for all tests, which run in an empty working folder.
class InstallTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempDir;
    before_ = std::filesystem::current_path();
    const auto [status, output] =
        RunProgram(DBR_CMAKE, {"--install", DBR_BUILD_DIR, "--prefix", *folder_ / "prefix"});
    ASSERT_EQ(status, 0) << output;
    std::filesystem::create_directory(*folder_ / "elsewhere");
    std::filesystem::current_path(*folder_ / "elsewhere");
  }
  static void TearDownTestSuite() {
    std::filesystem::current_path(before_);
    delete folder_;
  }

  static std::string Installed(const std::string& name) { return absl::StrCat(*folder_ / "prefix/", name); }
  static std::pair<int, std::string> Dbr(const std::vector<std::string>& arguments) {
    return RunProgram(Installed("bin/dbr"), arguments);
  }

  inline static TempDir* folder_ = nullptr;
  inline static std::filesystem::path before_;
};

TEST_F(InstallTest, PutsEachFileWhereSystemsLookForIt) {
  for (const char* name :
       {"bin/dbr", "bin/dbr-replay", "bin/dbr-learner", "bin/dbr-actor", "share/dbr/configs/hopper.textproto",
        "share/dbr/experiments/paper.textproto", "share/dbr/policies/hopper_medium.safetensors",
        "share/doc/dbr/LICENSE", "share/doc/dbr/README.md", "share/doc/dbr/docs/operations.md",
        "share/man/man1/dbr.1", "share/man/man1/dbr-launch.1", "share/man/man1/dbr-dataset-record.1",
        "share/man/man1/dbr-replay.1", "share/man/man1/dbr-learner.1", "share/man/man1/dbr-actor.1",
        "share/bash-completion/completions/dbr", "share/zsh/site-functions/_dbr",
        "share/fish/vendor_completions.d/dbr.fish"}) {
    EXPECT_TRUE(std::filesystem::is_regular_file(Installed(name))) << name;
  }
}

TEST_F(InstallTest, AnswersQuestions) {
  const auto [versioned, version] = Dbr({"--version"});
  EXPECT_EQ(versioned, 0);
  EXPECT_THAT(version, StartsWith("dbr " DBR_VERSION));
  const auto [listed, algorithms] = Dbr({"algorithms"});
  EXPECT_EQ(listed, 0);
  EXPECT_THAT(algorithms, HasSubstr("ddqn"));
}

TEST_F(InstallTest, LaunchesAShippedConfig) {
  const auto [status, output] =
      Dbr({"launch", "deploy/configs/connect4.textproto", "--run-dir", "run", "--set", "launch.max_seconds=3",
           "--set", "actor.processes=1", "--set", "evaluation.final_episodes=10", "--set",
           "evaluation.final_opponents=[random]"});
  ASSERT_EQ(status, 0) << output;
  EXPECT_EQ(Summary(RunFolder{"run"})["ended"], "max_seconds") << output;
}

TEST_F(InstallTest, FindsTheShippedGridAndPolicies) {
  const auto [planned, plan] =
      Dbr({"experiment", "deploy/experiments/paper.textproto", "--dry-run", "--only", "connect4"});
  EXPECT_EQ(planned, 0) << plan;
  const auto [filmed, film] =
      Dbr({"evaluate", "--policy", "deploy/policies/hopper_medium.safetensors", "--episodes", "1"});
  EXPECT_EQ(filmed, 0) << film;
}

TEST_F(InstallTest, SaysWhereItLookedForAConfig) {
  const auto [status, output] = Dbr({"launch", "deploy/configs/no_such.textproto"});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(output, AllOf(HasSubstr(*folder_ / "elsewhere"),
                            HasSubstr("share/dbr/configs/no_such.textproto"), HasSubstr(Installed("bin"))));
}

TEST_F(InstallTest, ManualPagesAndCompletionAreOfTheseCommands) {
  EXPECT_THAT(
      Contents(Installed("share/man/man1/dbr-launch.1")),
      AllOf(StartsWith(".TH DBR\\-LAUNCH 1"), HasSubstr("\\-\\-seed\\-buffer"), HasSubstr("EXIT STATUS")));
  const auto [status, offered] =
      RunProgram("/bin/bash", {"--norc", "-c",
                               absl::StrCat("source ", Installed("share/bash-completion/completions/dbr"),
                                            "; COMP_WORDS=(dbr dataset record --env ''); COMP_CWORD=4; _dbr; "
                                            "echo \"${COMPREPLY[*]}\"")});
  EXPECT_EQ(status, 0);
  EXPECT_EQ(offered, "hopper walker2d half_cheetah ant\n");
  EXPECT_THAT(Contents(Installed("share/zsh/site-functions/_dbr")), StartsWith("#compdef dbr"));
  EXPECT_THAT(Contents(Installed("share/fish/vendor_completions.d/dbr.fish")),
              HasSubstr("complete -c dbr -f"));
}

TEST_F(InstallTest, NoManualPageHasALetterThatTroffDoesNotRead) {
  for (const auto& page : std::filesystem::directory_iterator(Installed("share/man/man1"))) {
    const std::string text = Contents(page.path());
    EXPECT_TRUE(std::all_of(text.begin(), text.end(), [](char c) { return static_cast<signed char>(c) > 0; }))
        << page.path();
  }
}

}  // namespace
}  // namespace dbr
