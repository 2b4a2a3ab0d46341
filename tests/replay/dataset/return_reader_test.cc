#include "replay/dataset/return_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

constexpr float kDiscount = 0.75f;
constexpr int kHorizon = 4;  // 1 / (1 - kDiscount)

// Rewards and returns of each stretch.
struct Stretch {
  std::vector<float> rewards, returns;
};

class ReturnReaderTest : public ::testing::Test {
 protected:
  std::vector<Stretch> Read(DatasetOptions options = {}) {
    options.discount = kDiscount;
    auto reader = DatasetReader::Open(path_, options);
    EXPECT_TRUE(reader.ok()) << reader.status();
    ReturnReader returns(reader->get(), kDiscount);
    const TransitionLayout& layout = returns.layout();
    EXPECT_EQ(layout.return_width, 1);
    std::vector<Stretch> stretches;
    for (;;) {
      const auto rows = returns.Next();
      EXPECT_TRUE(rows.ok()) << rows.status();
      if (!rows.ok() || rows->empty()) return stretches;
      Stretch stretch;
      for (std::size_t from = 0; from < rows->size(); from += static_cast<std::size_t>(layout.stride())) {
        const TransitionView row = ViewRow(rows->data() + from, layout);
        stretch.rewards.push_back(row.reward);
        stretch.returns.push_back(row.monte_carlo_return);
      }
      stretches.push_back(std::move(stretch));
    }
  }

  // Expects the returns of `rewards`, with nothing or with a stationary continuation behind them.
  static void ExpectReturns(const Stretch& stretch, const std::vector<float>& rewards, bool terminal) {
    ASSERT_EQ(stretch.rewards, rewards);
    const std::size_t last = std::min<std::size_t>(rewards.size(), kHorizon);
    double value =
        terminal ? 0
                 : std::accumulate(rewards.end() - static_cast<std::ptrdiff_t>(last), rewards.end(), 0.0) /
                       static_cast<double>(last) / (1 - kDiscount);
    for (std::size_t t = rewards.size(); t-- > 0;) {
      value = rewards[t] + kDiscount * value;
      EXPECT_NEAR(stretch.returns[t], value, 1e-5) << t;
    }
  }

  TempDir folder_;
  const std::string path_ = folder_ / "file";
};

TEST_F(ReturnReaderTest, GivesEveryEpisodeOfEveryLayoutItsReturns) {
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/3, /*steps=*/500);
  for (const DatasetLayout layout :
       {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet, DatasetLayout::kMinari}) {
    SCOPED_TRACE(DatasetLayoutName(layout));
    if (layout == DatasetLayout::kMinari) {
      WriteMinari(path_, episodes);
    } else {
      WriteWithWriter(path_, episodes, layout);
    }
    const std::vector<Stretch> stretches = Read({.layout = layout});
    ASSERT_EQ(stretches.size(), episodes.size());
    for (std::size_t i = 0; i < episodes.size(); ++i) {
      ExpectReturns(stretches[i], episodes[i].rewards, episodes[i].ending == EpisodeEnding::kTerminal);
    }
  }
}

TEST_F(ReturnReaderTest, AnEpisodeLongerThanWhatIsReadAtOnceIsOneStretch) {
  const std::vector<TestEpisode> episodes = {MakeEpisode(1, 40000, EpisodeEnding::kTerminal),
                                             MakeEpisode(2, 3, EpisodeEnding::kTerminal),
                                             MakeEpisode(3, 20000, EpisodeEnding::kTimeLimit)};
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  const std::vector<Stretch> stretches = Read();
  ASSERT_EQ(stretches.size(), 3u);
  ExpectReturns(stretches[0], episodes[0].rewards, /*terminal=*/true);
  ExpectReturns(stretches[1], episodes[1].rewards, /*terminal=*/true);
  ExpectReturns(stretches[2], episodes[2].rewards, /*terminal=*/false);
}

TEST_F(ReturnReaderTest, WhatTheFileLeavesUnfinishedGoesOnAsACutDoes) {
  const std::vector<TestEpisode> episodes = {MakeEpisode(1, 6, EpisodeEnding::kTerminal),
                                             MakeEpisode(2, 2, EpisodeEnding::kUnfinished)};
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  const std::vector<Stretch> stretches = Read();
  ASSERT_EQ(stretches.size(), 2u);
  ExpectReturns(stretches[1], episodes[1].rewards, /*terminal=*/false);
}

TEST_F(ReturnReaderTest, ARowThatIsLeftOutBreaksItsEpisode) {
  std::vector<TestEpisode> episodes = {MakeEpisode(1, 9, EpisodeEnding::kTerminal)};
  episodes[0].rewards[5] = std::numeric_limits<float>::infinity();
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  const std::vector<float>& rewards = episodes[0].rewards;
  const std::vector<Stretch> stretches = Read({.skip_bad_rows = true});
  ASSERT_EQ(stretches.size(), 2u);
  ExpectReturns(stretches[0], {rewards.begin(), rewards.begin() + 5}, /*terminal=*/false);
  ExpectReturns(stretches[1], {rewards.begin() + 6, rewards.end()}, /*terminal=*/true);
}

TEST_F(ReturnReaderTest, GivesTheReadersErrors) {
  std::vector<TestEpisode> episodes = {MakeEpisode(1, 9, EpisodeEnding::kTerminal)};
  episodes[0].rewards[5] = std::numeric_limits<float>::infinity();
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  auto reader = DatasetReader::Open(path_, {});
  ReturnReader returns(reader->get(), kDiscount);
  EXPECT_THAT(returns.Next().status().ToString(), ::testing::HasSubstr("--skip-bad-rows"));
}

TEST_F(ReturnReaderTest, AnEmptyFileHasNoStretch) {
  WriteWithWriter(path_, {}, DatasetLayout::kD4rl);
  EXPECT_TRUE(Read().empty());
}

}  // namespace
}  // namespace dbr
