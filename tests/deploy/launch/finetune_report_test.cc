// What a launch tells of robots, seed buffers and phases.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/file_io.h"
#include "deploy/cli/stats_report.h"
#include "deploy/launch/evaluation_curve.h"
#include "deploy/launch/progress.h"
#include "deploy/launch/result_tables.h"
#include "deploy/launch/results.h"
#include "deploy/launch/summary_reader.h"
#include "deploy/terminal/terminal.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using Json = nlohmann::ordered_json;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

RunSample Sample(std::uint64_t updates, std::uint64_t steps) {
  RunSample sample;
  sample.replay = StatsReply();
  sample.replay->set_inserted(steps);
  sample.replay->set_seed_buffer_rows(1000000);
  sample.replay->set_seed_buffer_episodes(1012);
  sample.replay->set_seed_buffer_return_mean(1078.3);
  sample.learner = LearnerStatus();
  sample.learner->set_updates(updates);
  return sample;
}

RunSample Evaluated(RunSample sample, std::uint64_t version, std::uint64_t updates, double mean) {
  EvaluationReport* report = &sample.reports.emplace_back();
  report->set_policy_version(version);
  report->set_updates(updates);
  report->set_episodes(4);
  report->set_return_mean(mean);
  report->set_return_stderr(10);
  report->set_score_mean(kNaN);
  report->set_score_stderr(kNaN);
  sample.learner->clear_evaluations();
  *sample.learner->add_evaluations() = *report;  // the newest
  return sample;
}

TEST(EvaluationCurveTest, TakesEachEvaluationOnce) {
  EvaluationCurve curve;
  EXPECT_THAT(curve.Update(Sample(0, 0)), IsEmpty());
  EXPECT_THAT(curve.Update(Evaluated(Sample(200, 0), 2, 100, 500)), SizeIs(1));
  EXPECT_THAT(curve.Update(Evaluated(Sample(300, 0), 2, 100, 500)), IsEmpty());
  EXPECT_THAT(curve.Update(Evaluated(Sample(400, 0), 3, 350, 600)), SizeIs(1));
  ASSERT_THAT(curve.points(), SizeIs(2));
  EXPECT_EQ(curve.points()[1].updates, 350u);
  EXPECT_EQ(curve.points()[1].return_mean, 600);
  EXPECT_EQ(curve.points()[1].return_std, 20);  // of 4 episodes with a standard error of 10
}

TEST(EvaluationCurveTest, TakesAllEvaluationsOfASampleInTheirOrder) {
  EvaluationCurve curve;
  RunSample sample = Sample(500, 0);
  for (const int version : {1, 2, 3}) sample = Evaluated(sample, version, 100 * version, 10 * version);
  sample = Evaluated(sample, 2, 200, 20);  // an evaluator whose call was answered too late sends it again
  ASSERT_THAT(curve.Update(sample), SizeIs(3));
  for (const std::size_t i : {0, 1, 2}) EXPECT_EQ(curve.points()[i].policy_version, i + 1);
}

TEST(EvaluationCurveTest, KnowsThoseOfAnEarlierLaunchAndTellsAVersionThatComesAgainFromThem) {
  EvaluationCurve earlier;
  earlier.Update(Evaluated(Sample(300, 0), 2, 100, 500));
  EvaluationCurve curve(earlier.points());
  EXPECT_THAT(curve.Update(Evaluated(Sample(300, 0), 2, 100, 500)), IsEmpty());
  EXPECT_THAT(curve.Update(Evaluated(Sample(300, 0), 2, 150, 510)), SizeIs(1))
      << "a learner that was killed had pushed version 2 elsewhere";
}

TEST(EvaluationCurveTest, KnowsWhatActorsHadDoneWhenAPolicyWasMade) {
  EvaluationCurve curve;
  curve.Update(Sample(900, 0));
  curve.Update(Sample(1000, 0));
  curve.Update(Sample(1100, 50));
  curve.Update(Sample(1100, 80));  // the learner waits; the policy of update 1,100 was made before
  const auto steps = [&curve](std::uint64_t version, std::uint64_t updates) {
    return curve.Update(Evaluated(Sample(1200, 90), version, updates, 1)).at(0).steps;
  };
  EXPECT_EQ(steps(1, 950), 0u);
  EXPECT_EQ(steps(2, 1000), 0u);
  EXPECT_EQ(steps(3, 1050), 25u);
  EXPECT_EQ(steps(4, 1100), 50u);
  EXPECT_EQ(steps(5, 1300), 90u);
}

TEST(EvaluationCurveTest, FindsTheEndOfTheOfflinePhaseAndTheLowestPointAfter) {
  EvaluationCurve curve;
  EXPECT_FALSE(curve.AfterOffline(1000).has_value());
  curve.Update(Evaluated(Sample(100, 0), 1, 100, 10));
  curve.Update(Sample(1000, 0));
  curve.Update(Evaluated(Sample(1100, 50), 2, 1100, 900));
  EXPECT_EQ(curve.AfterOffline(1000)->updates, 1100u) << "nearer than the one at 100";
  EXPECT_EQ(curve.AfterOffline(105)->updates, 100u);
  curve.Update(Evaluated(Sample(1200, 70), 3, 1150, 700));
  curve.Update(Evaluated(Sample(1300, 90), 4, 1250, 800));
  EXPECT_EQ(curve.LowestOnline()->return_mean, 700);
}

TEST(RobotProgressTest, ShowsReturnsInPlaceOfScores) {
  Progress progress{.sample = Evaluated(Sample(1500, 3000), 9, 1400, 812.34), .left = {}, .presentation = {}};
  progress.sample.replay->set_episodes(17);
  progress.sample.replay->set_recent_return_mean(512.5);
  const std::string line = ProgressText(progress, 200);
  EXPECT_THAT(line, AllOf(HasSubstr("17 episodes"), HasSubstr("train return 512.5"),
                          HasSubstr("eval return 812.3"), Not(HasSubstr("games")), Not(HasSubstr("mcts"))));
  EXPECT_LE(DisplayWidth(ProgressText(progress, 79)), 79);
  EXPECT_THAT(ProgressText(progress, 79), AllOf(HasSubstr("17 ep"), HasSubstr("eval 812.3")));
}

TEST(RobotProgressTest, ShowsHowFarTheOfflinePhaseIs) {
  const Progress progress{
      .sample = Sample(12000, 0), .left = {}, .presentation = {}, .offline_updates = 50000};
  EXPECT_THAT(ProgressText(progress, 200),
              AllOf(HasSubstr("offline: 12,000 of 50,000 updates"), HasSubstr("eval return –"),
                    Not(HasSubstr("transitions/s")), Not(HasSubstr("train"))));
  EXPECT_THAT(ProgressText(progress, 79), HasSubstr("offline 12k/50k"));
}

EvaluationResult Final() {
  return {.env = "hopper",
          .opponent = "",
          .episodes = 1000,
          .seed = 3,
          .score_mean = kNaN,
          .score_stderr = kNaN,
          .return_mean = 2100.4,
          .return_stderr = 5.5,
          .return_std = 173.9,
          .return_min = 99.5,
          .return_max = 2500.25,
          .length_mean = 961.5};
}

// A run with every phase.
RunSummary Finetuned() {
  RunSummary summary;
  summary.env = "hopper";
  summary.seed_buffer.path = "medium.hdf5";
  summary.offline_updates = 1000;
  summary.Update(Sample(900, 0));
  summary.Update(Evaluated(Sample(1000, 0), 1, 1000, 1099.1));
  summary.Update(Evaluated(Sample(2000, 500), 2, 2000, 1012));
  summary.Update(Evaluated(Sample(3000, 1500), 3, 3000, 1500));
  summary.final_results = {Final()};
  return summary;
}

TEST(RobotResultsTest, TheTableShowsTheSpreadOfReturns) {
  const std::string table = ResultTable({Final()});
  for (const char* part : {"hopper", "1,000", "2100.4 ± 5.5", "173.9", "99.5", "2500.2", "961.5", "steps"})
    EXPECT_THAT(table, HasSubstr(part));
  EXPECT_THAT(table, Not(HasSubstr("paper")));
  const Json json = ToJson(Final());
  EXPECT_EQ(json["return"]["std"], 173.9);
  EXPECT_EQ(json["return"]["min"], 99.5);
  EXPECT_EQ(json["steps"]["mean"], 961.5);
}

TEST(RobotResultsTest, TheReturnsOfAllPhasesStandTogether) {
  const std::string table = ReturnsTable(Finetuned());
  EXPECT_THAT(table, AllOf(HasSubstr("1078.3"), HasSubstr("1,012 whole episodes"), HasSubstr("1099.1"),
                           HasSubstr("update 1,000, online step 0"), HasSubstr("1012.0"),
                           HasSubstr("update 2,000, online step 500"), HasSubstr("2100.4")));
  EXPECT_EQ(ReturnsTable(RunSummary()), "");
}

TEST(RobotResultsTest, TheSummaryHoldsTheCurveAndThePhases) {
  TempDir folder;
  const RunFolder run{folder.path()};
  ASSERT_TRUE(WriteSummary(Finetuned(), run).ok());
  const Json json = Json::parse(*ReadFile(run.summary()));
  EXPECT_EQ(json["seed_buffer"]["path"], "medium.hdf5");
  EXPECT_EQ(json["seed_buffer"]["rows"], 1000000);
  EXPECT_EQ(json["returns"]["seed_buffer"], 1078.3);
  EXPECT_EQ(json["returns"]["after_offline"]["return_mean"], 1099.1);
  EXPECT_EQ(json["returns"]["lowest_online"]["updates"], 2000);
  EXPECT_EQ(json["returns"]["end"]["mean"], 2100.4);
  EXPECT_EQ(json["returns"]["end"]["steps"], 1500);
  ASSERT_EQ(json["evaluations"].size(), 3);
  EXPECT_EQ(json["evaluations"][2]["steps"], 1500);
  EXPECT_EQ(json["evaluations"][2]["return_mean"], 1500);
  EXPECT_EQ(json["evaluations"][2]["return_std"], 20);
  EXPECT_EQ(json["evaluations"][2]["episodes"], 4);

  RunSummary read = ReadSummary(run);
  ASSERT_THAT(read.curve.points(), SizeIs(3));
  EXPECT_EQ(read.curve.points()[1].return_mean, 1012);
  EXPECT_TRUE(std::isnan(read.curve.points()[1].score_mean));
  EXPECT_THAT(read.Update(Evaluated(Sample(3100, 1600), 3, 3000, 1500)), IsEmpty()) << "known from before";
}

TEST(SeedBufferWarningsTest, TellOfEpisodesWithoutEndAndActionsOutsideTheRange) {
  RunSummary summary;
  EXPECT_THAT(SeedBufferWarnings(summary.seed_buffer), IsEmpty()) << "there is none";
  RunSample sample = Sample(0, 0);
  summary.Update(sample);
  EXPECT_THAT(SeedBufferWarnings(summary.seed_buffer), IsEmpty());
  sample.replay->set_seed_buffer_episodes(0);
  sample.replay->set_seed_buffer_actions_outside(1234);
  summary.Update(sample);
  EXPECT_THAT(SeedBufferWarnings(summary.seed_buffer),
              ElementsAre(HasSubstr("warning: seed buffer: no episode ends"), HasSubstr("1234 rows")));
}

TEST(SeedBufferWarningsTest, TheSummaryKeepsTheCountOfActionsOutside) {
  const TempDir folder;
  const RunFolder run{folder.path()};
  RunSummary summary = Finetuned();
  summary.seed_buffer.actions_outside = 7;
  ASSERT_TRUE(WriteSummary(summary, run).ok());
  EXPECT_EQ(LoadSummary(run)->seed_buffer.actions_outside, 7u);
}

TEST(SeedBufferStatsTest, TellOfItsShares) {
  StatsReply stats = *Sample(0, 25).replay;
  stats.set_total(100);
  stats.set_plus(40);
  stats.set_minus(50);
  stats.set_seed_buffer(75);
  stats.set_seed_buffer_plus(10);
  stats.set_seed_buffer_minus(25);
  const std::string text = StatsText("unix:run/replay.sock", stats);
  EXPECT_THAT(text, AllOf(HasSubstr("75% of D,  25% of D+,  50% of D-"),
                          HasSubstr("1,000,000 transitions came in"), HasSubstr("1078.3")));
  const Json json = ToJson(stats);
  EXPECT_EQ(json["sources"]["seed_buffer"]["share"], 0.75);
  EXPECT_EQ(json["sources"]["seed_buffer"]["plus_share"], 0.25);
  EXPECT_EQ(json["sources"]["online"]["minus_share"], 0.5);
  EXPECT_EQ(json["seed_buffer_rows"], 1000000);
  EXPECT_EQ(json["seed_buffer_return_mean"], 1078.3);
}

}  // namespace
}  // namespace dbr
