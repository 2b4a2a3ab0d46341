// Tests which policy of a run or a file is played, and the errors of choices that cannot be had.
#include "deploy/launch/played_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "actor/best_policy.h"
#include "core/file_io.h"
#include "core/run_folder.h"
#include "core/safetensors.h"
#include "deploy/cli/common_options.h"
#include "nn/policy_choice.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Floats = std::vector<float>;

const Floats kRaw = {0, 0, 1, 0}, kAverage = {0, 0, 0, 1}, kBest = {0, 0, 2, 3};

// Two actions, one observation, no hidden layer.
PolicySnapshot Snapshot(const Floats& raw, const Floats& average) {
  PolicySnapshot snapshot;
  snapshot.version = 7;
  snapshot.spec = {.env = "test",
                   .algorithm = "dbr",
                   .observation_size = 1,
                   .actions = {ActionKind::kDiscrete, 2},
                   .hidden_sizes = {}};
  snapshot.networks = {{kPolicyNetwork, raw}};
  if (!average.empty()) snapshot.networks.emplace_back(kPolicyAverage, average);
  return snapshot;
}

class PlayedPolicyTest : public testing::Test {
 protected:
  PlayedPolicyTest() {
    std::filesystem::create_directories(run_.policies());
    Save(Snapshot(kRaw, kAverage));
    BestPolicy(run_.best_policy(), "test by MODE").Offer(1, AVERAGE, Snapshot(kBest, {}));
    WriteConfig("");
  }
  void Save(const PolicySnapshot& newest) const {
    EXPECT_TRUE(SavePolicy(newest, run_.latest_policy()).ok());
  }
  void WriteConfig(const std::string& text) const {
    EXPECT_TRUE(WriteFileAtomically(run_.config(), text).ok());
  }
  static void ExpectPlays(const std::string& file_or_run, const std::string& which, PlayedChoice choice,
                          const Floats& parameters) {
    SCOPED_TRACE(file_or_run + " --which " + which);
    const auto played = OpenNamedPolicy(file_or_run, which);
    ASSERT_TRUE(played.ok()) << played.status();
    EXPECT_EQ(played->choice, choice);
    EXPECT_EQ(*played->networks->snapshot().Find(kPolicyNetwork), parameters);
    EXPECT_EQ(played->networks->snapshot().Find(kPolicyAverage), nullptr);
  }
  static std::string Message(const std::string& file_or_run, const std::string& which,
                             absl::StatusCode code = absl::StatusCode::kInvalidArgument) {
    const absl::Status status = OpenNamedPolicy(file_or_run, which).status();
    EXPECT_EQ(status.code(), code) << status;
    return std::string(status.message());
  }

  TempDir folder_;
  const RunFolder run_{folder_.path()};
};

TEST_F(PlayedPolicyTest, OfARunEachCanBeHad) {
  ExpectPlays(run_.root, "raw", PlayedChoice::kRaw, kRaw);
  ExpectPlays(run_.root, "Average", PlayedChoice::kAverage, kAverage);
  ExpectPlays(run_.root, "BEST", PlayedChoice::kBest, kBest);
}

TEST_F(PlayedPolicyTest, TheRunsConfigDecidesWhereNothingIsSaid) {
  ExpectPlays(run_.root, "", PlayedChoice::kAverage, kAverage);
  WriteConfig("evaluation { which: RAW }");
  ExpectPlays(run_.root, "", PlayedChoice::kRaw, kRaw);
  ExpectPlays(run_.root, "average", PlayedChoice::kAverage, kAverage);
  std::filesystem::remove(run_.config());
  ExpectPlays(run_.root, "", PlayedChoice::kAverage, kAverage);
}

TEST_F(PlayedPolicyTest, OfAFileTheAverageIsPlayedWhereThereIsOne) {
  WriteConfig("evaluation { which: RAW }");
  ExpectPlays(run_.latest_policy(), "", PlayedChoice::kAverage, kAverage);
  ExpectPlays(run_.latest_policy(), "raw", PlayedChoice::kRaw, kRaw);
  ExpectPlays(run_.best_policy(), "", PlayedChoice::kRaw, kBest);
}

TEST_F(PlayedPolicyTest, APolicyWithoutAnAverageNeedsNoConfig) {
  Save(Snapshot(kRaw, {}));
  WriteConfig("no_such_field: 1");
  ExpectPlays(run_.root, "", PlayedChoice::kRaw, kRaw);
}

TEST_F(PlayedPolicyTest, AConfigThatCannotBeReadIsNamedWithWhatToDo) {
  WriteConfig("no_such_field: 1");
  EXPECT_THAT(Message(run_.root, ""), AllOf(HasSubstr(run_.config()), HasSubstr("--which raw or --which")));
  ExpectPlays(run_.root, "raw", PlayedChoice::kRaw, kRaw);
}

TEST_F(PlayedPolicyTest, AnAverageThatIsMissingIsNamed) {
  Save(Snapshot(kRaw, {}));
  for (const std::string& named : {run_.root, run_.latest_policy()}) {
    EXPECT_THAT(Message(named, "average"),
                AllOf(HasSubstr("expected a policy with its average"),
                      HasSubstr(named + " of dbr with policy."), HasSubstr("Use --which raw")));
  }
}

TEST_F(PlayedPolicyTest, TheBestIsOfARunFolder) {
  EXPECT_THAT(Message(run_.latest_policy(), "best"),
              AllOf(HasSubstr("--which best: expected a run folder"), HasSubstr(run_.latest_policy()),
                    HasSubstr("leave out --which best")));
  std::filesystem::remove(run_.best_policy());
  EXPECT_THAT(Message(run_.root, "best", absl::StatusCode::kNotFound),
              AllOf(HasSubstr("has no policy/best.safetensors"), HasSubstr("--which raw")));
}

TEST_F(PlayedPolicyTest, AnUnknownChoiceIsNamed) {
  EXPECT_THAT(Message(run_.root, "newest"),
              HasSubstr("--which: expected raw, average or best, found 'newest'"));
}

// As dbr dataset record does.
TEST_F(PlayedPolicyTest, WithoutAChoiceOpenNamedPolicyGivesTheRawOne) {
  EXPECT_EQ(*(*OpenNamedPolicy(run_.root))->snapshot().Find(kPolicyNetwork), kRaw);
}

}  // namespace
}  // namespace dbr
