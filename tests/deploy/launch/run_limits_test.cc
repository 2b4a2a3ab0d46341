// When a run ends, and what a launch counts until then.
#include "deploy/launch/run_limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "deploy/launch/run_watch.h"

namespace dbr {
namespace {

using ::testing::Optional;

// A run of 100 s, 50 episodes, 4,000 steps or 1,000 updates.
Config FourLimits() {
  Config config;
  config.mutable_launch()->set_max_seconds(100);
  config.mutable_launch()->set_max_episodes(50);
  config.mutable_launch()->set_max_steps(4000);
  config.mutable_learner()->set_max_updates(1000);
  return config;
}

TEST(RunLimitsTest, AreSaidInWords) {
  Config config;
  EXPECT_EQ(RunLimits(config).Text("games"), "it is stopped");
  EXPECT_FALSE(RunLimits(config).any());
  config.mutable_launch()->set_stop_at_return(812.5);
  EXPECT_FALSE(RunLimits(config).any()) << "a return that may never be reached";
  config.mutable_launch()->set_max_seconds(61);
  config.mutable_launch()->set_max_episodes(5000);
  config.mutable_launch()->set_max_steps(6000);
  config.mutable_learner()->set_max_updates(7000);
  EXPECT_EQ(RunLimits(config).Text("games"),
            "1:01 or 5,000 games or 6,000 online steps or 7,000 updates or an evaluated return of 812.5");
  EXPECT_TRUE(RunLimits(config).any());
}

TEST(RunLimitsTest, AnyOfThemEndsTheRun) {
  const RunLimits limits(FourLimits());
  RunSummary summary;
  summary.training_s = 99.9;
  summary.games = 49;
  summary.transitions = 3999;
  summary.updates = 1000;
  EXPECT_EQ(limits.Reached(summary, {}, false), std::nullopt) << "the learner says when its updates are made";
  EXPECT_THAT(limits.Reached(summary, {}, true), Optional(RunEnding::kMaxUpdates));
  summary.transitions = 4000;
  EXPECT_THAT(limits.Reached(summary, {}, false), Optional(RunEnding::kMaxSteps));
  summary.games = 50;
  EXPECT_THAT(limits.Reached(summary, {}, false), Optional(RunEnding::kMaxEpisodes));
  summary.training_s = 100;
  EXPECT_THAT(limits.Reached(summary, {}, false), Optional(RunEnding::kMaxSeconds));
}

TEST(RunLimitsTest, ANewEvaluationThatReachesTheReturnEndsTheRun) {
  Config config;
  const EvaluationPoint good{.opponent = "", .return_mean = 5}, bad{.opponent = "", .return_mean = 4};
  EXPECT_EQ(RunLimits(config).Reached({}, {good}, false), std::nullopt);
  config.mutable_launch()->set_stop_at_return(5);
  EXPECT_EQ(RunLimits(config).Reached({}, {bad}, false), std::nullopt);
  EXPECT_THAT(RunLimits(config).Reached({}, {bad, good}, false), Optional(RunEnding::kStopAtReturn));
}

TEST(RunLimitsTest, TheNearestLimitSaysHowLongItTakes) {
  const RunLimits limits(FourLimits());
  RunSummary summary;
  summary.training_s = 10;
  summary.games = 20;
  summary.transitions = 1000;
  summary.updates = 500;
  EXPECT_THAT(limits.TimeLeft(summary, {}), Optional(absl::Seconds(90)));
  EXPECT_THAT(limits.TimeLeft(summary, {.episodes_per_second = 0.5}), Optional(absl::Seconds(60)));
  EXPECT_THAT(limits.TimeLeft(summary, {.episodes_per_second = 0.5, .steps_per_second = 100}),
              Optional(absl::Seconds(30)));
  EXPECT_THAT(limits.TimeLeft(summary, {.steps_per_second = 100, .updates_per_second = 50}),
              Optional(absl::Seconds(10)));
  EXPECT_EQ(RunLimits(Config()).TimeLeft(summary, {.updates_per_second = 50}), std::nullopt);
}

TEST(RunLimitsTest, TheDeadlineIsThatOfTheClockAlone) {
  const absl::Time now = absl::FromUnixSeconds(1000);
  RunSummary summary;
  summary.training_s = 40;
  EXPECT_EQ(RunLimits(FourLimits()).Deadline(summary, now), now + absl::Seconds(60));
  EXPECT_EQ(RunLimits(Config()).Deadline(summary, now), absl::InfiniteFuture());
}

TEST(RunLimitsTest, TheOfflinePhaseEndsWithItsUpdatesOrWithTheFirstTransition) {
  Config config;
  config.mutable_learner()->set_offline_updates(100);
  RunSample sample;
  EXPECT_FALSE(RunLimits(config).OfflinePhaseIsOver(sample)) << "nobody has answered yet";
  sample.replay = StatsReply();
  sample.learner = LearnerStatus();
  sample.learner->set_updates(99);
  EXPECT_FALSE(RunLimits(config).OfflinePhaseIsOver(sample));
  sample.learner->set_updates(100);
  EXPECT_TRUE(RunLimits(config).OfflinePhaseIsOver(sample));
  sample.learner->set_updates(50);  // from an older checkpoint
  sample.replay->set_inserted(1);
  EXPECT_TRUE(RunLimits(config).OfflinePhaseIsOver(sample));
  config.mutable_learner()->set_max_updates(100);
  EXPECT_FALSE(RunLimits(config).OfflinePhaseIsOver(sample)) << "a run without actors";
}

RunSample Counted(std::uint64_t episodes, std::uint64_t updates) {
  RunSample sample;
  sample.replay = StatsReply();
  sample.replay->set_episodes(episodes);
  sample.learner = LearnerStatus();
  sample.learner->set_updates(updates);
  return sample;
}

// The second launch of a run that has trained for 30 s.
RunSummary SecondLaunch() {
  RunSummary summary;
  summary.ended = RunEnding::kRunning;
  summary.launches = 2;
  summary.training_s = 30;
  summary.wall_s = 35;
  summary.restarts = 1;
  return summary;
}

TEST(RunWatchTest, TimesAndRestartsGoOnOverALaterLaunch) {
  const absl::Time start = absl::FromUnixSeconds(1000);
  RunWatch watch(FourLimits(), SecondLaunch());
  watch.Start(start);
  watch.StartTraining(start + absl::Seconds(5));
  watch.Observe(Counted(10, 200), /*restarts=*/2, start + absl::Seconds(15));
  watch.CountWallTime(start + absl::Seconds(20));
  EXPECT_EQ(watch.summary().training_s, 40);
  EXPECT_EQ(watch.summary().wall_s, 55);
  EXPECT_EQ(watch.summary().restarts, 3);
  EXPECT_EQ(watch.summary().games, 10);
  EXPECT_EQ(watch.summary().updates, 200);
  EXPECT_EQ(watch.summary().ended, RunEnding::kRunning);
  watch.Observe(Counted(10, 200), 2, start + absl::Seconds(75));
  EXPECT_EQ(watch.summary().ended, RunEnding::kMaxSeconds);
}

TEST(RunWatchTest, EpisodesAreForeseenByTheRateOfThisLaunch) {
  const absl::Time start = absl::FromUnixSeconds(1000);
  RunWatch watch(FourLimits(), SecondLaunch());
  watch.Start(start);
  watch.StartTraining(start);
  watch.Observe(Counted(20, 0), 0, start);
  EXPECT_THAT(watch.TimeLeft(Counted(20, 0)), Optional(absl::Seconds(70))) << "by the clock";
  watch.Observe(Counted(40, 0), 0, start + absl::Seconds(10));
  EXPECT_THAT(watch.TimeLeft(Counted(40, 0)), Optional(absl::Seconds(5))) << "20 in 10 s, and 10 to come";
}

EvaluationReport Returning(std::uint64_t version, double mean) {
  EvaluationReport report;
  report.set_policy_version(version);
  report.set_episodes(10);
  report.set_return_mean(mean);
  return report;
}

TEST(RunWatchTest, NoEvaluationThatReachesTheReturnIsPassedOver) {
  Config config;
  config.mutable_launch()->set_stop_at_return(100);
  const absl::Time start = absl::FromUnixSeconds(1000);
  for (const std::size_t place : {0, 1, 2}) {
    RunWatch watch(config, SecondLaunch());
    watch.Start(start);
    watch.StartTraining(start);
    RunSample sample = Counted(10, 200);
    for (const std::size_t i : {0, 1, 2}) sample.reports.push_back(Returning(i, i == place ? 100 : 50));
    watch.Observe(sample, 0, start);
    EXPECT_EQ(watch.summary().ended, RunEnding::kStopAtReturn) << place;
  }
  RunWatch watch(config, SecondLaunch());
  watch.Start(start);
  watch.StartTraining(start);
  RunSample early = Counted(10, 200);
  early.reports = {Returning(1, 120)};
  watch.Count(early);  // before training is looked at
  watch.Observe(Counted(10, 200), 0, start);
  EXPECT_EQ(watch.summary().ended, RunEnding::kStopAtReturn);
}

TEST(RunWatchTest, CountsTheEvaluationsThatItMissedOverAllLaunches) {
  const absl::Time start = absl::FromUnixSeconds(1000);
  RunSummary before = SecondLaunch();
  before.missed_evaluations = 5;
  RunWatch watch{Config(), before};
  watch.Start(start);
  watch.StartTraining(start);
  RunSample sample = Counted(10, 200);
  sample.missed_reports = 3;  // in this launch
  watch.Observe(sample, 0, start);
  watch.Observe(sample, 0, start);
  EXPECT_EQ(watch.summary().missed_evaluations, 8u);
}

TEST(RunWatchTest, IsDueToBeSavedOnceInTenSeconds) {
  const absl::Time now = absl::FromUnixSeconds(1000);
  RunWatch watch{Config(), RunSummary()};
  EXPECT_TRUE(watch.IsDueToBeSaved(now));
  EXPECT_FALSE(watch.IsDueToBeSaved(now + absl::Seconds(9)));
  EXPECT_TRUE(watch.IsDueToBeSaved(now + absl::Seconds(10)));
  EXPECT_FALSE(watch.IsDueToBeSaved(now + absl::Seconds(19)));
}

TEST(RunWatchTest, AFailureIsKeptWithItsWords) {
  RunWatch watch(Config(), SecondLaunch());
  watch.Fail(absl::InternalError("the learner died"));
  EXPECT_EQ(watch.summary().ended, RunEnding::kFailed);
  EXPECT_EQ(watch.summary().failure, "the learner died");
}

}  // namespace
}  // namespace dbr
