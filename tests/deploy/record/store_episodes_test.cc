// From the rows of a run's store back to episodes.
#include "deploy/record/store_episodes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "core/file_io.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::HasSubstr;

constexpr TransitionLayout kLayout = {.observation_width = 2, .action_width = 1};
constexpr int kMaxEpisodeSteps = 5;

class StoreEpisodesTest : public testing::Test {
 protected:
  void Open(std::uint64_t capacity) {
    auto store = TransitionStore::Open({.path = "", .env = "test", .layout = kLayout, .capacity = capacity});
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
    for (std::uint64_t id = 1; id <= 2; ++id) {
      ASSERT_TRUE(store_->writers().Open({.id = id, .name = "actor"}).ok());
    }
  }

  // Step `t` of an episode whose observations are (number, t).
  void Add(float number, int t, bool terminal, std::uint32_t writer = 0) {
    const float observation[] = {number, static_cast<float>(t)}, next[] = {number, static_cast<float>(t + 1)};
    const float action[] = {number * 100 + static_cast<float>(t)};
    if (store_->size() == store_->capacity()) store_->Evict();
    store_->Append({.observation = observation,
                    .action = action,
                    .mask = {},
                    .reward = static_cast<float>(t),
                    .discount = terminal ? 0.0f : 0.99f,
                    .next_observation = next,
                    .next_mask = {}},
                   {.writer = writer});
  }

  std::unique_ptr<TransitionStore> store_;
};

TEST_F(StoreEpisodesTest, InterleavedEnvironmentsComeApart) {
  Open(100);
  for (int t = 0; t < kMaxEpisodeSteps; ++t) {
    Add(1, t, /*terminal=*/false);
    if (t < 3) Add(2, t, /*terminal=*/t == 2);
    if (t >= 3) Add(3, t - 3, /*terminal=*/false);
  }
  const std::vector<StoreEpisode> episodes = LinkEpisodes(*store_, kMaxEpisodeSteps);
  ASSERT_EQ(episodes.size(), 3);
  EXPECT_EQ(episodes[0].slots.size(), kMaxEpisodeSteps);
  EXPECT_EQ(episodes[0].ending, EpisodeEnding::kTimeLimit);
  EXPECT_EQ(episodes[1].slots.size(), 3);
  EXPECT_EQ(episodes[1].ending, EpisodeEnding::kTerminal);
  EXPECT_EQ(episodes[2].slots.size(), 2);
  EXPECT_EQ(episodes[2].ending, EpisodeEnding::kUnfinished);

  const EpisodeRows rows = CopyEpisode(*store_, episodes[1], 3);
  EXPECT_EQ(rows.observations, (std::vector<float>{2, 0, 2, 1, 2, 2, 2, 3}));
  EXPECT_EQ(rows.actions, (std::vector<float>{200, 201, 202}));
  EXPECT_EQ(rows.rewards, (std::vector<float>{0, 1, 2}));
  EXPECT_EQ(rows.ending, EpisodeEnding::kTerminal);
  EXPECT_EQ(CopyEpisode(*store_, episodes[1], 2).ending, EpisodeEnding::kUnfinished);
}

TEST_F(StoreEpisodesTest, WritersDoNotMix) {
  Open(100);
  for (int t = 0; t < 3; ++t) {
    Add(1, t, /*terminal=*/t == 2, /*writer=*/0);
    Add(1, t, /*terminal=*/t == 2, /*writer=*/1);
  }
  const std::vector<StoreEpisode> episodes = LinkEpisodes(*store_, kMaxEpisodeSteps);
  ASSERT_EQ(episodes.size(), 2);
  for (const StoreEpisode& episode : episodes) {
    ASSERT_EQ(episode.slots.size(), 3);
    for (const std::uint32_t slot : episode.slots) {
      EXPECT_EQ(store_->labels(slot).writer, store_->labels(episode.slots[0]).writer);
    }
  }
}

TEST_F(StoreEpisodesTest, WhatWasEvictedIsMissingAtTheFront) {
  Open(4);
  for (int t = 0; t < 3; ++t) Add(1, t, /*terminal=*/t == 2);
  for (int t = 0; t < 2; ++t) Add(2, t, /*terminal=*/t == 1);
  const std::vector<StoreEpisode> episodes = LinkEpisodes(*store_, kMaxEpisodeSteps);
  ASSERT_EQ(episodes.size(), 2);
  EXPECT_EQ(CopyEpisode(*store_, episodes[0], 2).rewards, (std::vector<float>{1, 2}));
  EXPECT_EQ(episodes[0].ending, EpisodeEnding::kTerminal);
  EXPECT_EQ(episodes[1].slots.size(), 2);
}

TEST_F(StoreEpisodesTest, RowsOfASeedAreLeftOut) {
  Open(10);
  const std::vector<float> row(kLayout.stride(), 9.0f);
  store_->AppendSeedBuffer(row.data(), {.source = Source::kSeedBuffer});
  store_->CompleteSeedBuffer({}, /*pin=*/true);
  Add(1, 0, /*terminal=*/true);
  const std::vector<StoreEpisode> episodes = LinkEpisodes(*store_, kMaxEpisodeSteps);
  ASSERT_EQ(episodes.size(), 1);
  EXPECT_EQ(store_->row(episodes[0].slots[0])[0], 1);
}

TEST(OpenRunStoreTest, SaysWhatIsNoRun) {
  const TempDir folder;
  absl::Status status = OpenRunStore(folder / "nothing").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("config.textproto"));
  ASSERT_TRUE(WriteFileAtomically(folder / "config.textproto", "env { name: \"hopper\" }").ok());
  status = OpenRunStore(folder.path()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("replay.store"));
}

TEST(OpenRunStoreTest, RefusesTransitionsOfSeveralSteps) {
  const TempDir folder;
  ASSERT_TRUE(
      WriteFileAtomically(folder / "config.textproto", "env { name: \"hopper\" } algorithm { n_step: 3 }")
          .ok());
  ASSERT_TRUE(WriteFileAtomically(folder / "replay.store", "").ok());
  const absl::Status status = OpenRunStore(folder.path()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("expected a run with algorithm.n_step: 1, found 3"));
}

}  // namespace
}  // namespace dbr
