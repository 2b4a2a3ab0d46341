#include "deploy/cli/dataset_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include "absl/time/time.h"
#include "replay/dataset/dataset_writer.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

// Puts the signal mask back, so that other tests of the program can be interrupted.
class DatasetCommandTest : public testing::Test {
 protected:
  DatasetCommandTest() {
    pthread_sigmask(SIG_SETMASK, nullptr, &old_mask_);
    BlockShutdownSignals();
  }
  ~DatasetCommandTest() override { pthread_sigmask(SIG_SETMASK, &old_mask_, nullptr); }

  static void WriteFile(const std::string& path) {
    const EnvSpec env{.name = "robot",
                      .observation_size = 1,
                      .actions = {ActionKind::kContinuous, 1},
                      .max_episode_steps = 10};
    const std::vector<float> observations = {1, 2}, actions = {0}, rewards = {1};
    const auto writer = DatasetWriter::Create(path, {.layout = DatasetLayout::kD4rl, .env = env});
    ASSERT_TRUE(writer.ok()) << writer.status();
    ASSERT_TRUE((*writer)->Append({observations, actions, rewards, EpisodeEnding::kTerminal}).ok());
    ASSERT_TRUE((*writer)->Finish().ok());
  }

 private:
  sigset_t old_mask_;
};

TEST_F(DatasetCommandTest, ASignalEndsTheReadingOfAFile) {
  const TempDir folder;
  WriteFile(folder / "file");
  for (const int number : {SIGINT, SIGTERM}) {
    Interrupt interrupt;
    const absl::StatusOr<DatasetReport> whole = ReportDataset(folder / "file", std::nullopt, interrupt);
    ASSERT_TRUE(whole.ok()) << whole.status();
    EXPECT_EQ(whole->facts.transitions, 1);
    kill(getpid(), number);
    ASSERT_TRUE(interrupt.WaitFor(absl::Minutes(5)));
    EXPECT_EQ(ReportDataset(folder / "file", std::nullopt, interrupt).status().code(),
              absl::StatusCode::kCancelled);
  }
}

}  // namespace
}  // namespace dbr
