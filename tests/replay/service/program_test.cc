// The program dbr-replay itself: how it starts, stops, is killed and goes on.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/run_folder.h"
#include "proto/rpc/channel.h"
#include "replay/client/client.h"
#include "replay/client/writer.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

constexpr absl::Duration kPatience = absl::Seconds(60);
constexpr TransitionLayout kConnect4{.observation_width = 84, .action_width = 1, .mask_width = 7};

class ReplayProgram : public ::testing::Test {
 protected:
  ReplayProgram() : run_{folder_.path()} { WriteConfig("replay { capacity: 20000 min_size: 10 }"); }
  ~ReplayProgram() override {
    if (pid_ > 0) End(SIGKILL);
  }

  std::string config_path() const { return absl::StrCat(folder_.path(), "/given.textproto"); }
  std::string log_path() const { return absl::StrCat(folder_.path(), "/stderr"); }

  void WriteConfig(const std::string& text) { std::ofstream(config_path()) << text; }

  void Start(std::vector<std::string> arguments = {}) {
    arguments.insert(arguments.begin(), {absl::StrCat(DBR_BIN_DIR, "/dbr-replay"), "--config", config_path(),
                                         "--run-dir", run_.root});
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log_path().c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0644);
    ASSERT_EQ(posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
  }

  // Waits until the program serves.
  void AwaitServing() {
    const auto channel = MakeChannel(run_.replay_address());
    ASSERT_TRUE(channel->WaitForConnected(absl::ToChronoTime(absl::Now() + kPatience))) << Log();
  }

  // Waits for the exit status; sends `signal` first unless it is 0.
  int End(int signal) {
    if (signal != 0) kill(pid_, signal);
    int status = 0;
    EXPECT_EQ(waitpid(pid_, &status, 0), pid_);
    pid_ = -1;
    return status;
  }

  std::string Log() const { return ReadFile(log_path()).value_or(""); }

  std::unique_ptr<TransitionWriter> Writer() {
    WriterOptions options;
    options.address = run_.replay_address();
    options.name = "actor-0";
    options.layout = kConnect4;
    options.buffered_transitions = 500;
    return std::make_unique<TransitionWriter>(options);
  }
  static absl::Status Append(TransitionWriter* writer, std::uint64_t first, int count) {
    const Rows rows(kConnect4, first, count);
    for (int i = 0; i < count; ++i) {
      const absl::Status status =
          writer->Append(rows.columns().Row(kConnect4, i), 1, 1, std::nullopt, kPatience);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  TestFolder folder_;
  RunFolder run_;
  pid_t pid_ = -1;
};

TEST_F(ReplayProgram, StopsCleanlyAndGoesOn) {
  Start();
  const auto writer = Writer();
  ASSERT_TRUE(Append(writer.get(), 1, 300).ok());
  ASSERT_TRUE(writer->Flush(kPatience).ok());
  const int status = End(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << Log();
  EXPECT_THAT(Log(), HasSubstr(absl::StrCat("listening on ", run_.replay_address())));
  Start({"--resume"});
  AwaitServing();
  const auto stats = ReplayClient(run_.replay_address()).Stats(kPatience);
  ASSERT_TRUE(stats.ok()) << stats.status();
  EXPECT_EQ(stats->total(), 300u);
  EXPECT_EQ(stats->plus(), 300u);
}

TEST_F(ReplayProgram, LosesAndDoublesNothingWhenItIsKilled) {
  constexpr int kRows = 10000;
  Start();
  const auto writer = Writer();
  std::thread actor([&] { EXPECT_TRUE(Append(writer.get(), 1, kRows).ok()); });
  for (int kills = 0; kills < 3; ++kills) {
    const std::uint64_t acknowledged = writer->counters().acknowledged;
    while (acknowledged + 1000 < kRows && writer->counters().acknowledged < acknowledged + 1000) {
      std::this_thread::yield();
    }
    const int status = End(SIGKILL);
    EXPECT_TRUE(WIFSIGNALED(status)) << Log();
    Start({"--resume"});
  }
  actor.join();
  ASSERT_TRUE(writer->Flush(kPatience).ok());
  ReplayClient client(run_.replay_address());
  const auto stats = client.Stats(kPatience);
  ASSERT_TRUE(stats.ok()) << stats.status();
  EXPECT_EQ(stats->inserted(), static_cast<std::uint64_t>(kRows));
  EXPECT_EQ(stats->writers(0).last_sequence(), static_cast<std::uint64_t>(kRows));
  DrawnBatches drawn;
  ASSERT_TRUE(client.Sample({.uniform = 5000}, kConnect4, kPatience, &drawn).ok());
  for (int i = 0; i < 5000; ++i) ASSERT_EQ(Rows::Value(drawn.uniform.keys[i]), drawn.uniform.rewards[i]);
}

TEST_F(ReplayProgram, SaysWhatIsWrongAndHowToGoOn) {
  Start({"--no-such-flag"});
  EXPECT_EQ(WEXITSTATUS(End(0)), 2);
  WriteConfig("replay { capacity: 0 }");
  Start();
  EXPECT_EQ(WEXITSTATUS(End(0)), 2);
  EXPECT_THAT(Log(), HasSubstr("replay.capacity"));
  WriteConfig("replay { capacity: 1000000000000000 }");
  Start();
  EXPECT_EQ(WEXITSTATUS(End(0)), 2);
  EXPECT_THAT(Log(), HasSubstr("replay.byte_budget"));
  WriteConfig("replay { capacity: 100 }");  // the default min_size is 1000
  Start();
  EXPECT_EQ(WEXITSTATUS(End(0)), 2);
  EXPECT_THAT(Log(), HasSubstr("replay.min_size"));
  WriteConfig("replay { capacity: 2000 }");
  Start({"--resume"});
  EXPECT_EQ(WEXITSTATUS(End(0)), 2);
  EXPECT_THAT(Log(), HasSubstr("replay.store"));
  Start({"--address", "0.0.0.0:0"});
  EXPECT_EQ(WEXITSTATUS(End(0)), 2);
  EXPECT_THAT(Log(), HasSubstr("--allow-insecure"));
}

}  // namespace
}  // namespace dbr
