#include "actor/evaluation_loop.h"

#include <map>
#include <utility>
#include <vector>

#include "envs/registry/registry.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/actor/test_policies.h"

namespace dbr {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using PolicyPtr = std::shared_ptr<const PolicyNetworks>;
using Networks = std::vector<std::pair<std::string, std::vector<float>>>;

// Runs the loop with a clock of its own. Each wait moves the time to the deadline and then plays the next
// entry of the script.
class EvaluationLoopTest : public ::testing::Test {
 protected:
  EvaluationLoopTest()
      : EvaluationLoopTest(
            {.opponents = {"random", "one_ply"}, .episodes = 4, .seed = 1, .every = absl::Seconds(10)}) {}
  explicit EvaluationLoopTest(const EvaluationLoopOptions& options) : loop_(options, Ports()) {}

  EvaluationLoopPorts Ports() {
    return {.newest_policy = [this] { return newest_; },
            .report = [this](const EvaluationReport& report) { return Report(report); },
            .next_policy = [this](const auto& last, absl::Duration) { return NextPolicy(last); },
            .on_mean =
                [this](double mean, PolicyChoice played, const PolicySnapshot& snapshot) {
                  means_.emplace_back(snapshot.version, mean);
                  played_.emplace_back(played, snapshot.networks);
                },
            .now = [this] { return now_; },
            .wait_until =
                [this](absl::Time deadline) {
                  waits_.push_back(deadline - now_);
                  now_ = std::max(now_, deadline);
                  PlayNext();
                }};
  }

  // Plays the script's next entry and returns its result: a policy, an error, or nothing new before the
  // deadline.
  absl::StatusOr<PolicyPtr> NextPolicy(const PolicyPtr& last) {
    PlayNext();
    if (newest_.ok() && *newest_ == last) return absl::DeadlineExceededError("no new policy");
    return newest_;
  }

  void PlayNext() {
    if (script_.empty()) return loop_.Close();
    const auto next = std::move(script_.front());
    script_.pop_front();
    next();
  }

  absl::Status Report(const EvaluationReport& report) {
    now_ += time_of_a_report_;
    ++attempts_;
    if (!learner_.ok()) return learner_;
    reports_.emplace_back(report.policy_version(), report.opponent());
    scores_[report.policy_version()] += report.score_mean();
    whole_reports_.push_back(report);
    means_at_report_.push_back(means_.size());
    return absl::OkStatus();
  }

  void Push(std::uint64_t version) { newest_ = UntrainedPolicy(Connect4Spec(), version); }

  absl::Time now_ = absl::UnixEpoch();
  absl::Duration time_of_a_report_ = absl::ZeroDuration();
  absl::StatusOr<PolicyPtr> newest_ = nullptr;
  absl::Status learner_;
  int attempts_ = 0;
  std::vector<std::pair<std::uint64_t, std::string>> reports_;
  std::vector<EvaluationReport> whole_reports_;
  std::map<std::uint64_t, double> scores_;               // by version, summed over the opponents
  std::vector<std::pair<std::uint64_t, double>> means_;  // of each version
  std::vector<std::pair<PolicyChoice, Networks>> played_;
  std::vector<std::size_t> means_at_report_;  // how many there were before each report
  std::vector<absl::Duration> waits_;
  std::deque<std::function<void()>> script_;
  EvaluationLoop loop_;
};

TEST_F(EvaluationLoopTest, EvaluatesEachNewPolicyOnceAgainstEachOpponent) {
  script_ = {[&] { Push(3); }, [] {}, [&] { Push(4); }, [] {}};
  ASSERT_TRUE(loop_.Run().ok());
  EXPECT_THAT(reports_,
              ElementsAre(Pair(3, "random"), Pair(3, "one_ply"), Pair(4, "random"), Pair(4, "one_ply")));
}

TEST_F(EvaluationLoopTest, EvaluatesALowerVersionOfALearnerThatStartedAnew) {
  Push(7);
  script_ = {[&] { Push(2); }};
  ASSERT_TRUE(loop_.Run().ok());
  EXPECT_THAT(reports_,
              ElementsAre(Pair(7, "random"), Pair(7, "one_ply"), Pair(2, "random"), Pair(2, "one_ply")));
}

TEST_F(EvaluationLoopTest, KeepsItsDeadlinesAndCatchesUpAfterALongRound) {
  Push(1);
  time_of_a_report_ = absl::Seconds(3);
  script_ = {[] {},
             [&] {
               Push(2);
               time_of_a_report_ = absl::Seconds(11);
             }};
  ASSERT_TRUE(loop_.Run().ok());
  // The first round took 6 of the 10 s, the second none, the third 22.
  EXPECT_THAT(waits_, ElementsAre(absl::Seconds(4), absl::Seconds(10), absl::ZeroDuration()));
}

TEST_F(EvaluationLoopTest, GivesTheMeanOfEachPolicyBeforeItsLastReport) {
  Push(1);
  for (std::uint64_t version = 2; version <= 8; ++version)
    script_.push_back([this, version] { Push(version); });
  ASSERT_TRUE(loop_.Run().ok());
  std::vector<std::pair<std::uint64_t, double>> expected;
  for (const auto& [version, score] : scores_) expected.emplace_back(version, score / 2);
  EXPECT_EQ(means_, expected);
  EXPECT_EQ(means_.size(), 8u);
  // A reader of the last report may stop the run.
  EXPECT_EQ(means_at_report_[0], 0u);
  EXPECT_EQ(means_at_report_[1], 1u);
}

TEST_F(EvaluationLoopTest, KeepsReportsWhileThereIsNoLearner) {
  Push(1);
  learner_ = absl::UnavailableError("nobody there");
  script_ = {[&] { Push(2); }, [&] { learner_ = absl::OkStatus(); }};
  ASSERT_TRUE(loop_.Run().ok());
  EXPECT_THAT(reports_,
              ElementsAre(Pair(1, "random"), Pair(1, "one_ply"), Pair(2, "random"), Pair(2, "one_ply")));
}

TEST_F(EvaluationLoopTest, DropsReportsThatTheLearnerRefuses) {
  Push(1);
  learner_ = absl::InvalidArgumentError("unknown opponent");
  script_ = {[&] { learner_ = absl::OkStatus(); }};
  ASSERT_TRUE(loop_.Run().ok());
  EXPECT_THAT(reports_, IsEmpty());
  EXPECT_EQ(attempts_, 2);
}

TEST_F(EvaluationLoopTest, EndsWithTheErrorOfItsPolicies) {
  newest_ = absl::InvalidArgumentError("another environment");
  EXPECT_TRUE(absl::IsInvalidArgument(loop_.Run()));
}

class EvaluatedChoiceTest : public EvaluationLoopTest, public ::testing::WithParamInterface<PolicyChoice> {
 protected:
  EvaluatedChoiceTest()
      : EvaluationLoopTest({.opponents = {"random", "one_ply"},
                            .episodes = 50,
                            .seed = 1,
                            .which = GetParam(),
                            .every = absl::Seconds(10)}) {}

  // The mean return of a policy in the games that the loop plays with version 3.
  static double MeanOf(const PolicySnapshot& snapshot, const std::string& opponent) {
    const PolicyPtr policy = PolicyNetworks::Create(snapshot).value();
    return Evaluate(*policy, {.opponent = opponent, .episodes = 50, .seed = 1 + 3})->return_mean;
  }
};

TEST_P(EvaluatedChoiceTest, PlaysTheChosenPolicy) {
  const PolicySnapshot raw = UntrainedSnapshot(Connect4Spec(), 3);
  const PolicySnapshot average = UntrainedSnapshot(Connect4Spec(), 4);
  newest_ = PolicyNetworks::Create(WithAverage(raw, average)).value();
  ASSERT_TRUE(loop_.Run().ok());
  ASSERT_EQ(whole_reports_.size(), 2u);
  for (const EvaluationReport& report : whole_reports_) {
    const double of_raw = MeanOf(raw, report.opponent()), of_average = MeanOf(average, report.opponent());
    ASSERT_NE(of_raw, of_average) << "the test needs two policies that play differently";
    EXPECT_EQ(report.return_mean(), GetParam() == AVERAGE ? of_average : of_raw);
    EXPECT_EQ(report.policy_version(), 3u);
  }
  Networks expected = raw.networks;
  if (GetParam() == AVERAGE) expected[0] = average.networks[0];
  EXPECT_THAT(played_, ElementsAre(Pair(GetParam(), expected)));
}

TEST_P(EvaluatedChoiceTest, WithoutAnAverageTheRawPolicyPlays) {
  const PolicySnapshot raw = UntrainedSnapshot(Connect4Spec(), 3);
  newest_ = PolicyNetworks::Create(raw).value();
  ASSERT_TRUE(loop_.Run().ok());
  EXPECT_EQ(whole_reports_[0].return_mean(), MeanOf(raw, "random"));
  EXPECT_THAT(played_, ElementsAre(Pair(RAW, raw.networks)));
}

INSTANTIATE_TEST_SUITE_P(Choices, EvaluatedChoiceTest, ::testing::Values(RAW, AVERAGE),
                         [](const auto& info) { return PolicyChoice_Name(info.param); });

// Version v has 10 v updates, so it belongs to iteration v / 2.
class EvaluationByUpdatesTest : public EvaluationLoopTest {
 protected:
  explicit EvaluationByUpdatesTest(bool resumed = false)
      : EvaluationLoopTest({.opponents = {"random"},
                            .episodes = 4,
                            .seed = 1,
                            .every = absl::Seconds(10),
                            .every_updates = 20,
                            .resumed = resumed}) {}

  // Runs the loop while the learner publishes these versions in turn.
  void Publish(const std::vector<std::uint64_t>& versions) {
    for (const std::uint64_t version : versions) script_.push_back([this, version] { Push(version); });
    ASSERT_TRUE(loop_.Run().ok());
  }
  std::vector<std::uint64_t> iterations() const {
    std::vector<std::uint64_t> iterations;
    for (const EvaluationReport& report : whole_reports_) iterations.push_back(report.iteration());
    return iterations;
  }
  std::vector<std::vector<std::uint64_t>> skipped() const {
    std::vector<std::vector<std::uint64_t>> skipped;
    for (const EvaluationReport& report : whole_reports_)
      skipped.emplace_back(report.skipped_iterations().begin(), report.skipped_iterations().end());
    return skipped;
  }
};

TEST_F(EvaluationByUpdatesTest, EvaluatesTheFirstPolicyThatItSeesOfEachIteration) {
  Publish({0, 1, 2, 3, 5, 6});
  EXPECT_THAT(reports_,
              ElementsAre(Pair(0, "random"), Pair(2, "random"), Pair(5, "random"), Pair(6, "random")));
  EXPECT_THAT(iterations(), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(skipped(), Each(IsEmpty()));
}

TEST_F(EvaluationByUpdatesTest, NamesTheIterationsThatHavePassedMeanwhile) {
  Publish({0, 10, 11, 12, 18});
  EXPECT_THAT(iterations(), ElementsAre(0, 5, 6, 9));
  EXPECT_THAT(skipped(), ElementsAre(IsEmpty(), ElementsAre(1, 2, 3, 4), IsEmpty(), ElementsAre(7, 8)));
}

TEST_F(EvaluationByUpdatesTest, NamesWhatPassedBeforeItsFirstPolicy) {
  Publish({4});
  EXPECT_THAT(skipped(), ElementsAre(ElementsAre(0, 1)));
}

TEST_F(EvaluationByUpdatesTest, WaitsForPoliciesAndNeverForTheTime) {
  Publish({0, 2, 4});
  EXPECT_THAT(waits_, IsEmpty());
  EXPECT_EQ(now_, absl::UnixEpoch());
}

TEST_F(EvaluationByUpdatesTest, AnIterationThatIsTrainedAgainIsNotEvaluatedAgain) {
  Publish({0, 2, 4, 2, 3, 4, 6});
  EXPECT_THAT(iterations(), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(skipped(), Each(IsEmpty()));
}

TEST_F(EvaluationByUpdatesTest, EvaluatesThePolicyThatTheLearnerWaitsForOnce) {
  const auto push_last_offline = [this] {
    PolicySnapshot snapshot = UntrainedPolicy(Connect4Spec(), 3)->snapshot();
    snapshot.ends_offline_phase = true;
    newest_ = PolicyNetworks::Create(std::move(snapshot));
  };
  script_ = {[this] { Push(2); }, push_last_offline, push_last_offline, [this] { Push(4); }};
  ASSERT_TRUE(loop_.Run().ok());
  EXPECT_THAT(reports_, ElementsAre(Pair(2, "random"), Pair(3, "random"), Pair(4, "random")));
  EXPECT_THAT(iterations(), ElementsAre(1, 1, 2));
}

TEST_F(EvaluationByUpdatesTest, TriesKeptReportsAgainWhileThereIsNoNewPolicy) {
  learner_ = absl::UnavailableError("nobody there");
  script_ = {[&] { Push(0); }, [] {}, [&] { learner_ = absl::OkStatus(); }};
  Publish({});
  EXPECT_THAT(iterations(), ElementsAre(0));
}

TEST_F(EvaluationByUpdatesTest, EndsWithTheErrorOfItsPolicies) {
  script_ = {[&] { newest_ = absl::InvalidArgumentError("another environment"); }};
  EXPECT_TRUE(absl::IsInvalidArgument(loop_.Run()));
}

class ResumedEvaluationTest : public EvaluationByUpdatesTest {
 protected:
  ResumedEvaluationTest() : EvaluationByUpdatesTest(/*resumed=*/true) {}
};

TEST_F(ResumedEvaluationTest, LeavesTheIterationsBeforeItsFirstPolicyAlone) {
  Publish({8, 14});
  EXPECT_THAT(iterations(), ElementsAre(4, 7));
  EXPECT_THAT(skipped(), ElementsAre(IsEmpty(), ElementsAre(5, 6)));
}

TEST(OpponentsToEvaluateTest, PrefersTheConfigAndKnowsEnvironmentsWithoutOpponents) {
  EXPECT_THAT(OpponentsToEvaluate("connect4", {"mcts:7"}), ElementsAre("mcts:7"));
  EXPECT_EQ(OpponentsToEvaluate("connect4", {}), EvaluationOpponents("connect4"));
  EXPECT_THAT(OpponentsToEvaluate("line", {}), ElementsAre(""));
}

}  // namespace
}  // namespace dbr
