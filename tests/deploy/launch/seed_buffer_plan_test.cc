// What a launch makes of a seed buffer before the first process starts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "deploy/launch/run_plan.h"
#include "proto/config/config_file.h"
#include "replay/dataset/dataset_writer.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const absl::Time kNow = absl::FromUnixSeconds(1700000000);
constexpr int kSteps = 50;

// One episode of hopper's sizes.
void WriteSeedBuffer(const std::string& path, int observation_size = 15) {
  const EnvSpec env{.name = "hopper",
                    .observation_size = observation_size,
                    .actions = {ActionKind::kContinuous, 3},
                    .max_episode_steps = 1000};
  const std::vector<float> observations((kSteps + 1) * observation_size), actions(kSteps * 3),
      rewards(kSteps, 1.0f);
  const auto writer = DatasetWriter::Create(path, {.layout = DatasetLayout::kD4rl, .env = env});
  ASSERT_TRUE(writer.ok()) << writer.status();
  ASSERT_TRUE((*writer)->Append({observations, actions, rewards, EpisodeEnding::kTerminal}).ok());
  ASSERT_TRUE((*writer)->Finish().ok());
}

class SeedBufferPlanTest : public testing::Test {
 protected:
  SeedBufferPlanTest() {
    EXPECT_TRUE(WriteFileAtomically(config_,
                                    "env { name: 'hopper' } replay { capacity: 5000 min_size: 10 } "
                                    "learner { offline_updates: 100 } actor { processes: 2 }")
                    .ok());
    WriteSeedBuffer(seed_buffer_);
  }

  LaunchOptions Options(const std::string& seed_buffer, std::vector<std::string> overrides = {}) const {
    return {
        .config = config_, .overrides = std::move(overrides), .run_dir = run_, .seed_buffer = seed_buffer};
  }
  // Why there is no plan, and no folder.
  std::string Refusal(const LaunchOptions& options) const {
    const auto plan = PrepareRun(options, kNow);
    EXPECT_FALSE(plan.ok());
    EXPECT_FALSE(std::filesystem::exists(run_));
    return std::string(plan.status().message());
  }

  TempDir folder_;
  const std::string config_ = folder_ / "config.textproto";
  const std::string run_ = folder_ / "run";
  const std::string seed_buffer_ = folder_ / "seed.hdf5";
};

TEST_F(SeedBufferPlanTest, AFolderNamedWithASlashHasAName) {
  std::filesystem::create_directories(folder_ / "set/data");
  WriteSeedBuffer(folder_ / "set/data/main_data.hdf5");  // the file itself says that its layout is d4rl
  const auto plan = PrepareRun(Options(folder_ / "set/"), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->config.replay().seed_buffer().path(), folder_ / "set");
}

TEST_F(SeedBufferPlanTest, TheEffectiveConfigNamesTheSeedByItsAbsolutePath) {
  std::filesystem::current_path(folder_.path());
  LaunchOptions options = Options("./seed.hdf5");
  options.seed_layout = "d4rl";
  options.skip_bad_rows = true;
  const auto plan = PrepareRun(options, kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  const auto written = LoadConfig(plan->folder.config());
  ASSERT_TRUE(written.ok()) << written.status();
  EXPECT_EQ(written->replay().seed_buffer().path(), std::filesystem::current_path() / "seed.hdf5");
  EXPECT_EQ(written->replay().seed_buffer().layout(), "d4rl");
  EXPECT_TRUE(written->replay().seed_buffer().skip_bad_rows());
  EXPECT_THAT(Actors(*plan, "bin"), SizeIs(2));
}

TEST_F(SeedBufferPlanTest, TheConfigsOwnSeedIsMadeAbsoluteToo) {
  std::filesystem::current_path(folder_.path());
  const auto plan = PrepareRun(Options("", {"replay.seed_buffer.path=seed.hdf5"}), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->config.replay().seed_buffer().path(), std::filesystem::current_path() / "seed.hdf5");
}

TEST_F(SeedBufferPlanTest, UpdatesOnASeedNeedOne) {
  EXPECT_THAT(Refusal(Options("")), AllOf(HasSubstr("learner.offline_updates"), HasSubstr("--seed-buffer"),
                                          HasSubstr("dbr dataset record --env hopper")));
}

TEST_F(SeedBufferPlanTest, AShareOfASeedNeedsOne) {
  EXPECT_THAT(Refusal(Options("", {"learner.offline_updates=0", "replay.seed_buffer.share=0.5"})),
              AllOf(HasSubstr("replay.seed_buffer.share"), HasSubstr("--seed-buffer")));
}

TEST_F(SeedBufferPlanTest, FlagsForASeedNeedOne) {
  LaunchOptions options = Options("", {"learner.offline_updates=0"});
  options.skip_bad_rows = true;
  EXPECT_THAT(Refusal(options), HasSubstr("--seed-buffer"));
}

TEST_F(SeedBufferPlanTest, WhereEveryUpdateIsOfflineThereAreNoActors) {
  const auto plan = PrepareRun(Options(seed_buffer_, {"learner.max_updates=100"}), kNow);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->actors, 0);
  EXPECT_THAT(Actors(*plan, "bin"), IsEmpty());
  EXPECT_THAT(Services(*plan, "bin"), SizeIs(3));
}

TEST_F(SeedBufferPlanTest, ABadSeedIsRefusedBeforeAFolderIsMade) {
  EXPECT_THAT(Refusal(Options(folder_ / "none.hdf5")), HasSubstr("none.hdf5"));
  EXPECT_THAT(Refusal(Options(config_)), HasSubstr("config.textproto"));
  EXPECT_THAT(Refusal(Options(seed_buffer_, {"replay.capacity=49", "replay.min_size=1"})),
              AllOf(HasSubstr("has 50 transitions"), HasSubstr("room for 49")));
  EXPECT_THAT(Refusal(Options(seed_buffer_, {"replay.capacity=50", "replay.min_size=1"})),
              HasSubstr("replay.seed_buffer.evict"));
  EXPECT_THAT(Refusal(Options(seed_buffer_, {"replay.min_size=51"})), HasSubstr("expected at least 51"));
  WriteSeedBuffer(seed_buffer_, 22);
  EXPECT_THAT(Refusal(Options(seed_buffer_)),
              AllOf(HasSubstr("expected observations of 15"), HasSubstr("found 22")));
}

TEST_F(SeedBufferPlanTest, AResumedRunKeepsItsSeed) {
  ASSERT_TRUE(PrepareRun(Options(seed_buffer_), kNow).ok());
  ASSERT_TRUE(WriteFileAtomically(RunFolder{run_}.replay_store(), "its rows").ok());
  std::filesystem::remove(seed_buffer_);  // it lies in the store by now
  LaunchOptions resume{.run_dir = run_, .resume = true};
  EXPECT_TRUE(PrepareRun(resume, kNow).ok());
  resume.seed_buffer = folder_ / "other.hdf5";
  const auto other = PrepareRun(resume, kNow);
  EXPECT_EQ(other.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(other.status().message()),
              AllOf(HasSubstr("replay.seed_buffer.path"), HasSubstr("other.hdf5")));
  resume.seed_buffer.clear();
  resume.overrides = {"replay.seed_buffer.share=0.5"};
  EXPECT_TRUE(PrepareRun(resume, kNow).ok()) << "how it is drawn may change";
}

}  // namespace
}  // namespace dbr
