// Tests the program dbr-actor as a process: its exit codes, its error lines and its end on a signal.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/monotonic_clock.h"
#include "core/safetensors.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/actor/learner_double.h"
#include "tests/actor/test_policies.h"

namespace dbr {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr absl::Duration kLong = absl::Seconds(30);  // reached only where a test fails

// Runs dbr-actor and reads its standard error. It runs without OPENBLAS_NUM_THREADS, as users start it:
// OpenBLAS then has threads of its own before main.
class Program {
 public:
  explicit Program(std::vector<std::string> arguments) {
    int ends[2];
    DBR_CHECK(pipe2(ends, O_CLOEXEC) == 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
    arguments.insert(arguments.begin(), absl::StrCat(DBR_BIN_DIR, "/dbr-actor"));
    std::vector<char*> argv, envp;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    for (char** entry = environ; *entry != nullptr; ++entry) {
      if (!absl::StartsWith(*entry, "OPENBLAS_NUM_THREADS=")) envp.push_back(*entry);
    }
    envp.push_back(nullptr);
    signal(SIGINT, SIG_DFL);  // whoever runs the tests may have told them to ignore it
    DBR_CHECK(posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), envp.data()) == 0);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    output_fd_ = ends[0];
  }
  ~Program() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    close(output_fd_);
  }

  // Reads until `words` have come. Returns false where the output ended or took too long.
  bool AwaitOutput(const std::string& words) {
    while (!absl::StrContains(output_, words)) {
      if (!ReadMore()) return false;
    }
    return true;
  }
  void Signal(int number) { kill(pid_, number); }

  // Reads to the end. Returns the exit code, or minus the number of the signal that killed it.
  int Wait() {
    while (ReadMore()) continue;
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  const std::string& output() const { return output_; }

 private:
  bool ReadMore() {
    pollfd fd = {output_fd_, POLLIN, 0};
    const absl::Duration left = deadline_ - MonotonicNow();
    if (left <= absl::ZeroDuration() ||
        poll(&fd, 1, static_cast<int>(absl::ToInt64Milliseconds(left)) + 1) <= 0) {
      kill(pid_, SIGKILL);
      return false;
    }
    char bytes[4096];
    const ssize_t count = read(output_fd_, bytes, sizeof bytes);
    if (count > 0) output_.append(bytes, count);
    return count > 0;
  }

  const absl::Time deadline_ = MonotonicNow() + kLong;
  pid_t pid_ = 0;
  int output_fd_ = -1;
  std::string output_;
};

class ProgramTest : public ::testing::Test {
 protected:
  std::string WriteConfig(const std::string& text) const {
    const std::string path = folder_.path() + "/config.textproto";
    std::ofstream(path) << text;
    return path;
  }
  std::vector<std::string> Flags(const std::string& config) const {
    return {"--config", WriteConfig(config), "--run-dir", folder_.path()};
  }
  std::vector<std::string> EvaluatorFlags(const std::string& config) const {
    std::vector<std::string> flags = Flags(config);
    flags.push_back("--evaluate");
    return flags;
  }

  SocketFolder folder_;
};

constexpr char kSmall[] = "network { hidden_sizes: [16, 16] } actor { envs: 4 }";

TEST_F(ProgramTest, BadUsageExitsWith2) {
  Program unknown({"--no-such-flag"});
  EXPECT_EQ(unknown.Wait(), 2);
  Program incomplete({"--index", "1"});
  EXPECT_EQ(incomplete.Wait(), 2);
  EXPECT_THAT(incomplete.output(), HasSubstr("--config"));
}

TEST_F(ProgramTest, WhatIsNoWholeNumberExitsWith2) {
  for (const char* option : {"--index", "--processes"}) {
    for (const char* wrong : {"-1", "18446744073709551616", "1x", "1e3", "2000", ""}) {
      std::vector<std::string> flags = Flags(kSmall);
      flags.insert(flags.end(), {option, wrong});
      Program program(flags);
      EXPECT_EQ(program.Wait(), 2) << option << " " << wrong;
      EXPECT_THAT(program.output(), HasSubstr("expected a whole number of 0 to 102")) << option << wrong;
    }
  }
}

TEST_F(ProgramTest, WhatIsNoAddressExitsWith2) {
  for (const char* option : {"--replay", "--learner"}) {
    std::vector<std::string> flags = Flags(kSmall);
    flags.insert(flags.end(), {option, "127.0.0.1:99999"});
    Program program(flags);
    EXPECT_EQ(program.Wait(), 2) << option;
    EXPECT_THAT(program.output(), HasSubstr("'127.0.0.1:99999': expected unix:PATH or HOST:PORT")) << option;
  }
}

TEST_F(ProgramTest, BadConfigExitsWith2AndNamesTheField) {
  Program program(Flags("actor { envs: 0 }"));
  EXPECT_EQ(program.Wait(), 2);
  EXPECT_THAT(program.output(), HasSubstr("actor.envs"));

  Program other(Flags("env { name: 'chess' }"));
  EXPECT_EQ(other.Wait(), 2);
  EXPECT_THAT(other.output(), HasSubstr("chess"));

  Program evaluator(EvaluatorFlags("evaluation { opponents: 'nobody' }"));
  EXPECT_EQ(evaluator.Wait(), 2);
  EXPECT_THAT(evaluator.output(), HasSubstr("nobody"));
}

TEST_F(ProgramTest, EndsCleanlyOnASignalWhileThereIsNoLearner) {
  for (const int signal_number : {SIGTERM, SIGINT}) {
    Program actor(Flags(kSmall));
    ASSERT_TRUE(actor.AwaitOutput("no policies from the learner")) << actor.output();
    actor.Signal(signal_number);
    EXPECT_EQ(actor.Wait(), 0) << actor.output();

    Program evaluator(EvaluatorFlags(kSmall));
    ASSERT_TRUE(evaluator.AwaitOutput("no policies from the learner")) << evaluator.output();
    evaluator.Signal(signal_number);
    EXPECT_EQ(evaluator.Wait(), 0) << evaluator.output();
  }
}

TEST_F(ProgramTest, APolicyOfOtherSizesExitsWith2AsAnotherStartWouldNotHelp) {
  LearnerDouble learner(folder_.Address("learner"));
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  Program actor(Flags("network { hidden_sizes: [32, 16] } actor { envs: 4 }"));
  EXPECT_EQ(actor.Wait(), 2);
  EXPECT_THAT(actor.output(), HasSubstr("hidden_sizes: expected 32-16, found 16-16"));
}

TEST_F(ProgramTest, ALearnerOfAnotherProtocolExitsWith2AndSaysWhichProgramIsOlder) {
  LearnerDouble learner(folder_.Address("learner"), /*protocol_version=*/0);
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  Program actor(Flags(kSmall));
  EXPECT_EQ(actor.Wait(), 2);
  EXPECT_THAT(actor.output(), HasSubstr("found 0 (a program from before 0.2.0): the learner is older"));
}

TEST_F(ProgramTest, EvaluatorReportsToTheLearnerUntilItIsStopped) {
  LearnerDouble learner(folder_.Address("learner"));
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 7)));
  Program evaluator(EvaluatorFlags(std::string(kSmall) +
                                   "evaluation { opponents: ['random', 'mcts:5'] episodes: 6 every_s: 1 }"));
  ASSERT_TRUE(learner.AwaitReports(2, kLong));
  evaluator.Signal(SIGTERM);
  EXPECT_EQ(evaluator.Wait(), 0) << evaluator.output();
  const std::vector<EvaluationReport> reports = learner.reports();
  EXPECT_EQ(reports[0].opponent(), "random");
  EXPECT_EQ(reports[1].opponent(), "mcts:5");
  for (const EvaluationReport& report : reports) {
    EXPECT_EQ(report.policy_version(), 7);
    EXPECT_EQ(report.updates(), 70);
    EXPECT_EQ(report.env(), "connect4");
    EXPECT_EQ(report.episodes(), 6);
    EXPECT_NEAR(report.return_mean(), 2 * report.score_mean() - 1, 1e-12);
    EXPECT_GE(report.score_stderr(), 0);
  }
}

TEST_F(ProgramTest, EvaluatorPlaysTheAverageUnlessTheConfigSaysRaw) {
  const std::string evaluation = "episodes: 50 every_s: 1000000 every_updates: 20 opponents: 'random'";
  const PolicySnapshot raw = UntrainedSnapshot(Connect4Spec(), 3);
  const PolicySnapshot both = WithAverage(raw, UntrainedSnapshot(Connect4Spec(), 4));
  const std::string best = folder_.path() + "/policy/best.safetensors";
  // The mean return, and which policy the best file says.
  const auto evaluate = [&](const PolicySnapshot& snapshot, const std::string& which) {
    std::filesystem::remove(best);
    LearnerDouble learner(folder_.Address("learner"));
    learner.Offer(Encode(snapshot));
    Program evaluator(EvaluatorFlags(absl::StrCat(kSmall, " evaluation { ", evaluation, which, " }")));
    EXPECT_TRUE(learner.AwaitReports(1, kLong));
    evaluator.Signal(SIGTERM);
    EXPECT_EQ(evaluator.Wait(), 0) << evaluator.output();
    return std::pair(learner.reports()[0].return_mean(), LoadTensors(best)->metadata["evaluation.policy"]);
  };
  const auto alone = evaluate(raw, "");
  EXPECT_EQ(alone.second, "raw");
  EXPECT_EQ(evaluate(both, " which: RAW"), alone);
  const auto average = evaluate(both, "");
  EXPECT_NE(average.first, alone.first);
  EXPECT_EQ(average.second, "average");
}

TEST_F(ProgramTest, EvaluatorByUpdatesWakesForANewPolicyAndNamesWhatItSkips) {
  LearnerDouble learner(folder_.Address("learner"));
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  Program evaluator(
      EvaluatorFlags(std::string(kSmall) +
                     "evaluation { opponents: 'random' episodes: 6 every_s: 1000000 every_updates: 20 }"));
  ASSERT_TRUE(learner.AwaitReports(1, kLong));
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 8)));
  ASSERT_TRUE(learner.AwaitReports(2, kLong));
  evaluator.Signal(SIGTERM);
  EXPECT_EQ(evaluator.Wait(), 0) << evaluator.output();
  const std::vector<EvaluationReport> reports = learner.reports();
  EXPECT_EQ(reports[0].iteration(), 0);
  EXPECT_THAT(reports[0].skipped_iterations(), IsEmpty());
  EXPECT_EQ(reports[1].iteration(), 4);
  EXPECT_THAT(reports[1].skipped_iterations(), ElementsAre(1, 2, 3));
  EXPECT_THAT(evaluator.output(), HasSubstr("iterations 1 to 3 are skipped, 3 so far"));
}

}  // namespace
}  // namespace dbr
