// A replay server that begins with a file of offline data, and what it says of bad ones.
#include "replay/service/seed_buffer_import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "replay/client/client.h"
#include "replay/client/writer.h"
#include "replay/service/replay_server.h"
#include "tests/replay/dataset/dataset_files.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr absl::Duration kPatience = absl::Seconds(60);
constexpr TransitionLayout kLayout{.observation_width = kTestObservationSize,
                                   .action_width = kTestActionWidth};

class SeedBufferImportTest : public ::testing::Test {
 protected:
  SeedBufferImportTest() : episodes_(MakeEpisodes(1, 3000)), expected_(Expected(episodes_, 0.75f)) {
    WriteWithWriter(path_, episodes_, DatasetLayout::kD4rl);
    options_.store = {.path = absl::StrCat(folder_.path(), "/replay.store"),
                      .env = "test_robot",
                      .layout = kLayout,
                      .capacity = 10000};
    options_.seed_buffer.path = path_;
    options_.seed_buffer.env = "test_robot";
    options_.seed_buffer.discount = 0.75f;
    options_.server.address = absl::StrCat("unix:", folder_.path(), "/replay.sock");
  }

  std::uint64_t rows() const { return expected_.rows.size(); }

  void Start() {
    server_.reset();
    auto server = ReplayServer::Start(options_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = std::move(*server);
    options_.store.resume = true;
  }
  // The error with which the server does not start; a failed start leaves no store behind.
  absl::Status StartError() {
    const absl::Status status = ReplayServer::Start(options_).status();
    EXPECT_NE(access(options_.store.path.c_str(), F_OK), 0);
    return status;
  }
  StatsReply Stats() {
    auto stats = ReplayClient(options_.server.address).Stats(kPatience);
    EXPECT_TRUE(stats.ok()) << stats.status();
    return stats.ok() ? *stats : StatsReply();
  }

  TestFolder folder_;
  const std::string path_ = absl::StrCat(folder_.path(), "/seed.hdf5");
  const std::vector<TestEpisode> episodes_;
  const Reading expected_;
  ReplayServerOptions options_;
  std::unique_ptr<ReplayServer> server_;
};

TEST_F(SeedBufferImportTest, HoldsEveryTransitionOfTheFile) {
  Start();
  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  ASSERT_TRUE(client.Sample({.uniform = 2000}, kLayout, kPatience, &drawn).ok());
  for (int i = 0; i < drawn.uniform.size(); ++i) {
    const std::vector<float>& row = expected_.rows[drawn.uniform.keys[i] - 1];  // in the file's order
    ASSERT_EQ(drawn.uniform.observations(2, i), row[2]);
    ASSERT_EQ(drawn.uniform.actions(1, i), row[kLayout.action_offset() + 1]);
    ASSERT_EQ(drawn.uniform.rewards[i], row[kLayout.reward_offset()]);
    ASSERT_EQ(drawn.uniform.discounts[i], row[kLayout.discount_offset()]);
    ASSERT_EQ(drawn.uniform.next_observations(0, i), row[kLayout.next_observation_offset()]);
  }
}

TEST_F(SeedBufferImportTest, RowsCarryTheReturnsOfTheirEpisodesWhereTheyAreWanted) {
  options_.store.layout.return_width = 1;
  Start();
  std::vector<double> returns(rows());
  std::size_t end = 0;
  for (const TestEpisode& episode : episodes_) {
    end += static_cast<std::size_t>(episode.steps());
    double value = 0;
    if (episode.ending == EpisodeEnding::kTimeLimit) {
      const int last = std::min(episode.steps(), 4);  // 1 / (1 - 0.75)
      for (int t = episode.steps() - last; t < episode.steps(); ++t)
        value += episode.rewards[t] / last / 0.25;
    }
    for (int t = episode.steps(); t-- > 0;)
      returns[end - static_cast<std::size_t>(episode.steps() - t)] = value =
          episode.rewards[t] + 0.75 * value;
  }
  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  ASSERT_TRUE(client.Sample({.uniform = 2000}, options_.store.layout, kPatience, &drawn).ok());
  for (int i = 0; i < drawn.uniform.size(); ++i) {
    const std::size_t row = drawn.uniform.keys[i] - 1;
    ASSERT_NEAR(drawn.uniform.returns[i], returns[row], 1e-5) << row;
    ASSERT_EQ(drawn.uniform.rewards[i], expected_.rows[row][kLayout.reward_offset()]);
    ASSERT_EQ(drawn.uniform.next_observations(0, i), expected_.rows[row][kLayout.next_observation_offset()]);
  }
}

TEST_F(SeedBufferImportTest, AnImportWithReturnsThatWasBrokenOffGoesOnWithinAnEpisode) {
  options_.store.layout.return_width = 1;
  const TransitionLayout layout = options_.store.layout;
  Start();
  server_.reset();
  std::vector<float> whole;
  {
    auto store = *TransitionStore::Open(options_.store);
    for (std::uint32_t slot = 0; slot < rows(); ++slot) {
      whole.insert(whole.end(), store->row(slot), store->row(slot) + layout.stride());
    }
  }
  options_.store.resume = false;
  options_.store.path += ".2";
  const std::size_t some = static_cast<std::size_t>(episodes_[0].steps() + episodes_[1].steps()) + 1;
  {
    auto buffer = *PartitionedBuffer::Make(*TransitionStore::Open(options_.store), {});
    ASSERT_TRUE(buffer->InsertSeedBuffer(absl::MakeConstSpan(whole).first(some * layout.stride())).ok());
  }
  options_.store.resume = true;
  Start();
  server_.reset();
  auto store = *TransitionStore::Open(options_.store);
  ASSERT_EQ(store->size(), rows());
  for (std::uint32_t slot = 0; slot < rows(); ++slot) {
    ASSERT_EQ(store->row(slot)[layout.return_offset()],
              whole[std::size_t{slot} * layout.stride() + layout.return_offset()]);
  }
}

TEST_F(SeedBufferImportTest, ReturnsOfCutEpisodesNeedADiscountBelowOne) {
  options_.store.layout.return_width = 1;
  options_.seed_buffer.discount = 1;
  EXPECT_THAT(StartError().ToString(), HasSubstr("algorithm.discount: expected below 1"));
}

TEST_F(SeedBufferImportTest, StatsTellOfTheSeedBufferApart) {
  Start();
  const StatsReply stats = Stats();
  EXPECT_EQ(stats.total(), rows());
  EXPECT_EQ(stats.seed_buffer(), rows());
  EXPECT_EQ(stats.seed_buffer_rows(), rows());
  EXPECT_EQ(stats.unjudged(), rows());
  EXPECT_EQ(stats.inserted(), 0u);
  EXPECT_EQ(stats.episodes(), 0u);
  EXPECT_TRUE(std::isnan(stats.recent_return_mean()));
  EXPECT_EQ(stats.seed_buffer_episodes(), static_cast<std::uint64_t>(expected_.facts.episodes));
  EXPECT_NEAR(stats.seed_buffer_return_mean(), expected_.facts.return_mean, 1e-6);
  EXPECT_NEAR(stats.seed_buffer_return_max(), expected_.facts.return_max, 1e-6);
  EXPECT_GT(stats.seed_buffer_rows_per_second(), 0);
  ASSERT_EQ(stats.writers_size(), 1);
  EXPECT_EQ(stats.writers(0).name(), "seed_buffer");
  EXPECT_EQ(stats.writers(0).source(), SEED_BUFFER);
}

TEST_F(SeedBufferImportTest, AResumedServerDoesNotLoadItAgain) {
  Start();
  const SeedBufferRecord first = server_->seed_buffer();
  WriterOptions writer_options;
  writer_options.address = options_.server.address;
  writer_options.name = "actor-0";
  writer_options.layout = kLayout;
  TransitionWriter writer(writer_options);
  const Rows row(kLayout, 1, 1);
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(writer.Append(row.columns().Row(kLayout, 0), 1, 1, std::nullopt, kPatience).ok());
  }
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  unlink(path_.c_str());
  Start();
  EXPECT_EQ(server_->seed_buffer().rows_per_second, first.rows_per_second);
  EXPECT_EQ(Stats().total(), rows() + 50);
  EXPECT_EQ(Stats().seed_buffer(), rows());
  EXPECT_EQ(Stats().inserted(), 50u);
}

TEST_F(SeedBufferImportTest, GoesOnWithAnImportThatWasBrokenOff) {
  {
    auto buffer = *PartitionedBuffer::Make(*TransitionStore::Open(options_.store), {});
    const std::uint64_t some = rows() / 3;
    std::vector<float> flat;
    for (std::uint64_t i = 0; i < some; ++i)
      flat.insert(flat.end(), expected_.rows[i].begin(), expected_.rows[i].end());
    ASSERT_TRUE(buffer->InsertSeedBuffer(flat).ok());
  }
  options_.store.resume = true;
  Start();
  EXPECT_EQ(Stats().total(), rows());
  EXPECT_EQ(Stats().seed_buffer_episodes(), static_cast<std::uint64_t>(expected_.facts.episodes));
  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  ASSERT_TRUE(client.Sample({.uniform = 2000}, kLayout, kPatience, &drawn).ok());
  for (int i = 0; i < drawn.uniform.size(); ++i) {
    ASSERT_EQ(drawn.uniform.rewards[i], expected_.rows[drawn.uniform.keys[i] - 1][kLayout.reward_offset()]);
  }
}

TEST_F(SeedBufferImportTest, ASeedLargerThanTheCapacityIsRefusedWithBothNumbers) {
  options_.store.capacity = rows() - 1;
  const absl::Status status = StartError();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(status.ToString(), AllOf(HasSubstr(absl::StrCat(rows(), " transitions")),
                                       HasSubstr(absl::StrCat("room for ", rows() - 1)), HasSubstr(path_)));
}

TEST_F(SeedBufferImportTest, ASeedThatFillsTheBufferMustLeaveRoomForActors) {
  options_.store.capacity = rows();
  EXPECT_THAT(StartError().ToString(), AllOf(HasSubstr(absl::StrCat("all ", rows(), " places")),
                                             HasSubstr("replay.seed_buffer.evict")));
  options_.seed_buffer.evict = true;
  Start();
  options_.seed_buffer.evict = false;
  options_.seed_buffer.others_will_come = false;
  options_.store.resume = false;
  options_.store.path += ".2";
  Start();
  EXPECT_EQ(Stats().total(), rows());
}

TEST_F(SeedBufferImportTest, ASeedTooSmallForTheFirstDrawIsRefusedWhereItIsAlone) {
  options_.seed_buffer.min_rows = rows() + 1;
  EXPECT_THAT(StartError().ToString(),
              AllOf(HasSubstr(absl::StrCat("at least ", rows() + 1)), HasSubstr("replay.min_size"),
                    HasSubstr(absl::StrCat("found ", rows()))));
  options_.seed_buffer.min_rows = rows();
  Start();
}

TEST_F(SeedBufferImportTest, AnotherRobotsSeedIsRefused) {
  options_.store.layout.observation_width = 15;
  const absl::Status status = StartError();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(status.ToString(), AllOf(HasSubstr("expected observations of 15"), HasSubstr("found 3")));
}

TEST_F(SeedBufferImportTest, ASeedForDiscreteActionsIsRefused) {
  options_.store.layout = kSmallLayout;
  EXPECT_THAT(StartError().ToString(), HasSubstr("continuous actions"));
}

TEST_F(SeedBufferImportTest, TheLayoutIsNamedAndNeverGuessed) {
  WriteRaw(path_, D4rlColumns(episodes_), {});
  EXPECT_THAT(StartError().ToString(), HasSubstr("expected a named layout"));
  options_.seed_buffer.layout = "d4lr";
  EXPECT_THAT(StartError().ToString(), AllOf(HasSubstr("d4rl_pybullet"), HasSubstr("d4lr")));
  options_.seed_buffer.layout = "d4rl";
  Start();
  EXPECT_EQ(Stats().total(), rows());
}

TEST_F(SeedBufferImportTest, BadRowsAreRefusedOrCountedAndLeftOut) {
  std::vector<TestEpisode> episodes = episodes_;
  episodes[2].rewards[0] = std::numeric_limits<float>::quiet_NaN();
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  EXPECT_THAT(StartError().ToString(),
              AllOf(HasSubstr("NaN or infinity in 1 of"), HasSubstr("--skip-bad-rows")));
  options_.seed_buffer.skip_bad_rows = true;
  Start();
  EXPECT_EQ(Stats().total(), rows() - 1);
  EXPECT_EQ(Stats().seed_buffer_bad_rows(), 1u);
  EXPECT_TRUE(std::isfinite(Stats().seed_buffer_return_mean()));
}

TEST_F(SeedBufferImportTest, ActionsOutsideTheRangeAreKeptAndCounted) {
  std::vector<TestEpisode> episodes = episodes_;
  episodes[1].actions[0] = 1.5;
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  Start();
  EXPECT_EQ(Stats().total(), rows());
  EXPECT_EQ(Stats().seed_buffer_actions_outside(), 1u);
  Start();
  EXPECT_EQ(Stats().seed_buffer_actions_outside(), 1u) << "the store remembers it";
}

TEST_F(SeedBufferImportTest, AStoppedImportKeepsItsStoreAndCanBeResumed) {
  std::atomic<bool> cancelled = true;
  options_.seed_buffer.cancelled = &cancelled;
  EXPECT_EQ(ReplayServer::Start(options_).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(CheckSeedBufferFits(options_.seed_buffer, kLayout, options_.store.capacity).code(),
            absl::StatusCode::kCancelled);
  cancelled = false;
  options_.store.resume = true;
  Start();
  EXPECT_EQ(Stats().seed_buffer_rows(), rows());
}

TEST_F(SeedBufferImportTest, AMissingFileIsSaid) {
  options_.seed_buffer.path = absl::StrCat(folder_.path(), "/none.hdf5");
  const absl::Status status = StartError();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(status.ToString(), HasSubstr(options_.seed_buffer.path));
}

TEST(ReplayServerOptionsTest, TakesTheSeedFromTheConfig) {
  Config config;
  config.mutable_env()->set_name("hopper");
  config.mutable_algorithm()->set_discount(0.5);
  SeedBufferConfig* seed_buffer = config.mutable_replay()->mutable_seed_buffer();
  seed_buffer->set_path("some.hdf5");
  seed_buffer->set_layout("minari");
  seed_buffer->set_share(0.25);
  seed_buffer->set_final_share(0.125);
  seed_buffer->set_share_decay_transitions(5000);
  seed_buffer->set_evict(true);
  seed_buffer->set_skip_bad_rows(true);
  EXPECT_EQ(OptionsFrom(config, kLayout).seed_buffer.n_step, 1);
  config.mutable_algorithm()->set_n_step(5);
  ReplayServerOptions options = OptionsFrom(config, kLayout);
  EXPECT_EQ(options.seed_buffer.n_step, 5);
  EXPECT_EQ(options.seed_buffer.path, "some.hdf5");
  EXPECT_EQ(options.seed_buffer.layout, "minari");
  EXPECT_EQ(options.seed_buffer.env, "hopper");
  EXPECT_EQ(options.seed_buffer.discount, 0.5f);
  EXPECT_TRUE(options.seed_buffer.evict);
  EXPECT_TRUE(options.seed_buffer.skip_bad_rows);
  EXPECT_TRUE(options.seed_buffer.others_will_come);
  EXPECT_EQ(options.buffer.seed_buffer_share.first, 0.25);
  EXPECT_EQ(options.buffer.seed_buffer_share.final, 0.125);
  EXPECT_EQ(options.buffer.seed_buffer_share.decay_rows, 5000u);
  EXPECT_EQ(options.seed_buffer.min_rows, 0u);
  config.mutable_learner()->set_offline_updates(100);
  EXPECT_EQ(OptionsFrom(config, kLayout).seed_buffer.min_rows, 1000u);
  config.mutable_learner()->set_max_updates(100);
  EXPECT_FALSE(OptionsFrom(config, kLayout).seed_buffer.others_will_come);
  config.mutable_learner()->set_max_updates(101);
  EXPECT_TRUE(OptionsFrom(config, kLayout).seed_buffer.others_will_come);
}

}  // namespace
}  // namespace dbr
