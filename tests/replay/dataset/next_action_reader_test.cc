#include "replay/dataset/next_action_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

struct Row {
  float reward;
  std::vector<float> next_action;
  bool starts;
};

class NextActionReaderTest : public ::testing::Test {
 protected:
  std::vector<Row> Read(DatasetOptions options = {}) {
    options.discount = 0.75f;
    auto reader = DatasetReader::Open(path_, options);
    EXPECT_TRUE(reader.ok()) << reader.status();
    NextActionReader next_actions(reader->get());
    const TransitionLayout& layout = next_actions.layout();
    EXPECT_EQ(layout.next_action_width, kTestActionWidth);
    std::vector<Row> rows;
    for (;;) {
      const auto read = next_actions.Next();
      EXPECT_TRUE(read.ok()) << read.status();
      if (!read.ok() || read->empty()) return rows;
      const auto stride = static_cast<std::size_t>(layout.stride());
      for (std::size_t i = 0; i * stride < read->size(); ++i) {
        const TransitionView row = ViewRow(read->data() + i * stride, layout);
        rows.push_back(
            {row.reward, {row.next_action.begin(), row.next_action.end()}, next_actions.Starts(i)});
      }
    }
  }

  // What a plain loop over the episodes gives.
  static std::vector<Row> Expected(const std::vector<TestEpisode>& episodes) {
    std::vector<Row> rows;
    for (const TestEpisode& episode : episodes) {
      for (int t = 0; t < episode.steps(); ++t) {
        std::vector<float> next_action(kTestActionWidth, 0.0f);
        if (t + 1 < episode.steps()) {
          const auto first = episode.actions.begin() + (t + 1) * kTestActionWidth;
          next_action.assign(first, first + kTestActionWidth);
        } else if (episode.ending != EpisodeEnding::kTerminal) {
          continue;  // nothing says what would have been done
        }
        rows.push_back({episode.rewards[static_cast<std::size_t>(t)], next_action, t == 0});
      }
    }
    return rows;
  }

  static void ExpectSame(const std::vector<Row>& found, const std::vector<Row>& expected) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_EQ(found[i].reward, expected[i].reward) << i;
      EXPECT_EQ(found[i].next_action, expected[i].next_action) << i;
      EXPECT_EQ(found[i].starts, expected[i].starts) << i;
    }
  }

  TempDir folder_;
  const std::string path_ = folder_ / "file";
};

TEST_F(NextActionReaderTest, GivesEachTransitionOfMinariTheActionAfterIt) {
  const std::vector<TestEpisode> episodes = MakeEpisodes(/*seed=*/3, /*steps=*/500);
  WriteMinari(path_, episodes);
  ExpectSame(Read({.layout = DatasetLayout::kMinari}), Expected(episodes));
}

TEST_F(NextActionReaderTest, StretchesLongerThanWhatIsReadAtOnceStayWhole) {
  const std::vector<TestEpisode> episodes = {MakeEpisode(1, 10000, EpisodeEnding::kTerminal),
                                             MakeEpisode(2, 3, EpisodeEnding::kTerminal)};
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  ExpectSame(Read(), Expected(episodes));
}

TEST_F(NextActionReaderTest, LeavesOutWhatStandsBeforeAGap) {
  std::vector<TestEpisode> episodes = {MakeEpisode(1, 9, EpisodeEnding::kTerminal)};
  episodes[0].rewards[5] = std::numeric_limits<float>::infinity();
  WriteWithWriter(path_, episodes, DatasetLayout::kD4rl);
  std::vector<Row> expected = Expected(episodes);
  expected.erase(expected.begin() + 4, expected.begin() + 6);  // the row before the bad one, and that one
  expected[4].starts = true;
  ExpectSame(Read({.skip_bad_rows = true}), expected);
}

// Two episodes of a file in which nothing but the next observations tells them apart.
TEST_F(NextActionReaderTest, ABreakInTheNextObservationsIsNotSteppedOver) {
  const std::vector<TestEpisode> episodes = {MakeEpisode(1, 5, EpisodeEnding::kTimeLimit),
                                             MakeEpisode(2, 2, EpisodeEnding::kTimeLimit),
                                             MakeEpisode(3, 4, EpisodeEnding::kTerminal)};
  WriteRaw(path_, D4rlColumns(episodes), {"timeouts"});
  ExpectSame(Read({.layout = DatasetLayout::kD4rl}), Expected(episodes));
}

}  // namespace
}  // namespace dbr
