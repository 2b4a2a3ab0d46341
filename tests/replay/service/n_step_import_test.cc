// A replay buffer that begins with offline data as transitions of several steps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "replay/service/seed_buffer_import.h"
#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

constexpr float kDiscount = 0.75f;
constexpr TransitionLayout kLayout{.observation_width = kTestObservationSize,
                                   .action_width = kTestActionWidth};
constexpr TransitionLayout kWithReturns{
    .observation_width = kTestObservationSize, .action_width = kTestActionWidth, .return_width = 1};

using Row = std::vector<float>;

// The transitions of one unbroken stretch of an episode, its steps first to last, by the definition. Without
// a return.
void PlainLoop(const TestEpisode& episode, int first, int last, int n, std::vector<Row>* rows) {
  constexpr int kSize = kTestObservationSize;
  for (int t = first; t <= last; ++t) {
    const int end = std::min(t + n, last + 1);  // the number of the state that the transition leads to
    double reward = 0;
    for (int k = t; k < end; ++k) reward += std::pow(kDiscount, k - t) * episode.rewards[k];
    const bool terminal = episode.ending == EpisodeEnding::kTerminal && end == episode.steps();
    const auto observation = episode.observations.begin();
    Row row(observation + t * kSize, observation + (t + 1) * kSize);
    row.insert(row.end(), episode.actions.begin() + t * kTestActionWidth,
               episode.actions.begin() + (t + 1) * kTestActionWidth);
    row.push_back(static_cast<float>(reward));
    row.push_back(terminal ? 0 : static_cast<float>(std::pow(kDiscount, end - t)));
    row.insert(row.end(), observation + end * kSize, observation + (end + 1) * kSize);
    rows->push_back(row);
  }
}

std::vector<Row> PlainLoop(const std::vector<TestEpisode>& episodes, int n) {
  std::vector<Row> rows;
  for (const TestEpisode& episode : episodes) PlainLoop(episode, 0, episode.steps() - 1, n, &rows);
  return rows;
}

class NStepImportTest : public testing::Test {
 protected:
  // What the buffer holds after the import of the file. The rows' returns are put into returns_ instead.
  std::vector<Row> Import(int n_step, const std::string& layout, const TransitionLayout& row_layout = kLayout,
                          bool skip_bad_rows = false) {
    const std::string path = folder_ / "replay.store";
    std::filesystem::remove(path);
    {
      auto buffer = *PartitionedBuffer::Make(
          *TransitionStore::Open(
              {.path = path, .env = "test_robot", .layout = row_layout, .capacity = 10000}),
          {});
      const auto record = ImportSeedBuffer({.path = path_,
                                            .layout = layout,
                                            .env = "test_robot",
                                            .discount = kDiscount,
                                            .n_step = n_step,
                                            .skip_bad_rows = skip_bad_rows},
                                           buffer.get());
      EXPECT_TRUE(record.ok()) << record.status();
      if (record.ok()) record_ = *record;
    }
    return RowsOf(path, row_layout);
  }

  std::vector<Row> RowsOf(const std::string& path, const TransitionLayout& layout) {
    const auto store = TransitionStore::Open(
        {.path = path, .env = "test_robot", .layout = layout, .capacity = 10000, .resume = true});
    EXPECT_TRUE(store.ok()) << store.status();
    std::vector<Row> rows;
    returns_.clear();
    for (std::uint32_t slot = 0; slot < (*store)->size(); ++slot) {
      Row row((*store)->row(slot), (*store)->row(slot) + layout.stride());
      if (layout.return_width > 0) {
        returns_.push_back(row[layout.return_offset()]);
        row.erase(row.begin() + layout.return_offset());
      }
      rows.push_back(row);
    }
    return rows;
  }

  static void ExpectSame(const std::vector<Row>& actual, const std::vector<Row>& expected) {
    ASSERT_EQ(actual.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      // The sums may differ in a float's last digits, where they are made in another order.
      ASSERT_THAT(actual[i], testing::Pointwise(testing::FloatNear(1e-6f), expected[i])) << "row " << i;
      ASSERT_EQ(actual[i][kLayout.discount_offset()] == 0, expected[i][kLayout.discount_offset()] == 0);
    }
  }

  TempDir folder_;
  const std::string path_ = folder_ / "seed.hdf5";
  const std::vector<TestEpisode> episodes_ = MakeEpisodes(1, 5000);  // more than one chunk
  SeedBufferRecord record_;
  std::vector<float> returns_;
};

TEST_F(NStepImportTest, EveryLayoutGivesThePlainLoopsTransitions) {
  const std::vector<Row> expected = PlainLoop(episodes_, 3), single = PlainLoop(episodes_, 1);
  ASSERT_NE(expected, single);
  for (const DatasetLayout layout : {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet}) {
    SCOPED_TRACE(DatasetLayoutName(layout));
    WriteWithWriter(path_, episodes_, layout);
    EXPECT_EQ(Import(1, ""), single);
    const SeedBufferRecord one_step = record_;
    ExpectSame(Import(3, ""), expected);
    EXPECT_EQ(record_.rows, one_step.rows);
    EXPECT_EQ(record_.episodes, one_step.episodes);
    EXPECT_EQ(record_.return_mean, one_step.return_mean);
  }
  const std::vector<TestEpisode> some(episodes_.begin(), episodes_.begin() + 40);  // a group each is slow
  WriteMinari(path_, some);
  ExpectSame(Import(3, "minari"), PlainLoop(some, 3));
  ExpectSame(Import(7, "minari"), PlainLoop(some, 7));
}

// Without `next_observations` the step at a time limit is no transition.
TEST_F(NStepImportTest, WhereAStepIsNoTransitionTheOnesBeforeItEnd) {
  WriteRaw(path_, D4rlColumns(episodes_), {"next_observations"});
  std::vector<Row> expected;
  for (const TestEpisode& episode : episodes_) {
    const bool cut = episode.ending == EpisodeEnding::kTimeLimit;
    std::vector<Row> rows;
    PlainLoop(episode, 0, episode.steps() - (cut ? 2 : 1), 3, &rows);
    expected.insert(expected.end(), rows.begin(), rows.end());
  }
  // A terminal step's next observation is any: the file has none.
  std::vector<Row> actual = Import(3, "d4rl");
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (expected[i][kLayout.discount_offset()] != 0) continue;
    actual[i].resize(static_cast<std::size_t>(kLayout.next_observation_offset()));
    expected[i].resize(actual[i].size());
  }
  ExpectSame(actual, expected);
}

TEST_F(NStepImportTest, ABadRowThatIsLeftOutIsNotSteppedOver) {
  std::vector<TestEpisode> episodes = {MakeEpisode(1, 9, EpisodeEnding::kTerminal)};
  episodes[0].rewards[4] = std::numeric_limits<float>::quiet_NaN();
  WriteMinari(path_, episodes);
  std::vector<Row> expected;
  PlainLoop(episodes[0], 0, 2, 3, &expected);  // step 3 leads into the bad row, which takes it along
  PlainLoop(episodes[0], 5, 8, 3, &expected);
  ExpectSame(Import(3, "minari", kLayout, /*skip_bad_rows=*/true), expected);
}

// Two episodes of a file in which nothing but the next observations tells them apart.
TEST_F(NStepImportTest, ABreakInTheNextObservationsIsNotSteppedOver) {
  const std::vector<TestEpisode> episodes = {MakeEpisode(1, 5, EpisodeEnding::kTimeLimit),
                                             MakeEpisode(2, 2, EpisodeEnding::kTimeLimit),
                                             MakeEpisode(3, 4, EpisodeEnding::kTerminal)};
  WriteRaw(path_, D4rlColumns(episodes), {"timeouts"});
  ExpectSame(Import(3, "d4rl"), PlainLoop(episodes, 3));
}

TEST_F(NStepImportTest, ReturnsAreThoseOfTheStartAndTheSameAsOfSingleSteps) {
  WriteWithWriter(path_, episodes_, DatasetLayout::kD4rl);
  ExpectSame(Import(1, "", kWithReturns), PlainLoop(episodes_, 1));
  const std::vector<float> single = returns_;
  ExpectSame(Import(3, "", kWithReturns), PlainLoop(episodes_, 3));
  EXPECT_EQ(returns_, single);
}

TEST_F(NStepImportTest, AnImportThatWasBrokenOffGoesOnWithinAnEpisode) {
  WriteWithWriter(path_, episodes_, DatasetLayout::kD4rl);
  const std::vector<Row> whole = Import(3, "");
  auto buffer = *PartitionedBuffer::Make(
      *TransitionStore::Open(
          {.path = folder_ / "2.store", .env = "test_robot", .layout = kLayout, .capacity = 10000}),
      {});
  std::vector<float> some;
  for (int i = 0; i < 1234; ++i) some.insert(some.end(), whole[i].begin(), whole[i].end());
  ASSERT_TRUE(buffer->InsertSeedBuffer(some).ok());
  const auto record = ImportSeedBuffer(
      {.path = path_, .layout = "", .env = "test_robot", .discount = kDiscount, .n_step = 3}, buffer.get());
  ASSERT_TRUE(record.ok()) << record.status();
  buffer.reset();
  EXPECT_EQ(RowsOf(folder_ / "2.store", kLayout), whole);
}

}  // namespace
}  // namespace dbr
