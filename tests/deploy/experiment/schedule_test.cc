// The order of cells, how long they take, and the screen that tells of it.
#include "deploy/experiment/schedule.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "deploy/experiment/progress.h"
#include "deploy/experiment/status_screen.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Eq;
using ::testing::HasSubstr;
using ::testing::Optional;
using ::testing::SizeIs;

constexpr Capacity kTwoCores{.jobs = 0, .cores = 2};

TEST(ScheduleTest, TakesAsManyAsTheCoresCarry) {
  Schedule schedule({{1, 1}, {1, 1}, {1, 1}}, kTwoCores);
  EXPECT_THAT(schedule.Next(), Optional(0));
  EXPECT_THAT(schedule.Next(), Optional(1));
  EXPECT_EQ(schedule.Next(), std::nullopt);
  schedule.Finish(0);
  EXPECT_THAT(schedule.Next(), Optional(2));
  EXPECT_EQ(schedule.waiting(), 0);
  EXPECT_EQ(schedule.running(), 2);
}

TEST(ScheduleTest, OneAlwaysRuns) {
  Schedule schedule({{1, 9}, {1, 9}}, kTwoCores);
  EXPECT_THAT(schedule.Next(), Optional(0));
  EXPECT_EQ(schedule.Next(), std::nullopt);
}

TEST(ScheduleTest, ANumberOfJobsCountsCellsAndNotCores) {
  Schedule schedule({{1, 9}, {1, 9}, {1, 9}}, {.jobs = 2, .cores = 1});
  EXPECT_THAT(schedule.Next(), Optional(0));
  EXPECT_THAT(schedule.Next(), Optional(1));
  EXPECT_EQ(schedule.Next(), std::nullopt);
}

TEST(ScheduleTest, ASmallCellFillsTheCoreThatALargeOneOfItsSeedLeaves) {
  Schedule schedule({{1, 1}, {1, 2}, {1, 1}, {2, 1}}, kTwoCores);
  EXPECT_THAT(schedule.Next(), Optional(0));
  EXPECT_THAT(schedule.Next(), Optional(2));
  schedule.Finish(0);
  EXPECT_EQ(schedule.Next(), std::nullopt) << "the second seed waits until the first is all under way";
  schedule.Finish(2);
  EXPECT_THAT(schedule.Next(), Optional(1));
  schedule.Finish(1);
  EXPECT_THAT(schedule.Next(), Optional(3));
}

TEST(ScheduleTest, CostsACoreForTheLearnerAndOneForEachActor) {
  Config config;
  config.mutable_actor()->set_processes(3);
  EXPECT_EQ(CellCost(config), 4);
  config.mutable_learner()->set_offline_updates(10);
  config.mutable_learner()->set_max_updates(10);
  EXPECT_EQ(CellCost(config), 1) << "offline";
}

TEST(TimeToFinishTest, PlaysTheScheduleOut) {
  Schedule schedule({{1, 1}, {1, 1}, {1, 1}, {2, 2}}, kTwoCores);
  const std::vector<absl::Duration> takes(4, absl::Minutes(10));
  EXPECT_EQ(TimeToFinish(schedule, {}, takes), absl::Minutes(30));
  EXPECT_THAT(schedule.Next(), Optional(0));
  EXPECT_THAT(schedule.Next(), Optional(1));
  EXPECT_EQ(TimeToFinish(schedule, {{0, absl::Minutes(1)}, {1, absl::Minutes(4)}}, takes), absl::Minutes(21));
  EXPECT_EQ(schedule.waiting(), 2) << "the schedule itself stays as it is";
}

Cell MakeCell(const std::string& task, const std::string& contender, Task::Kind kind) {
  Cell cell;
  cell.task = task;
  cell.contender = contender;
  cell.kind = kind;
  return cell;
}

TEST(CellDurationsTest, TheNearestInKindTell) {
  CellDurations durations;
  const Cell known = MakeCell("hopper", "dbr", Task::ONLINE);
  EXPECT_EQ(durations.Expected(known), std::nullopt);
  durations.Add(known, absl::Minutes(10));
  durations.Add(known, absl::Minutes(20));
  durations.Add(MakeCell("hopper", "sac", Task::ONLINE), absl::Minutes(3));
  durations.Add(MakeCell("ant", "sac", Task::ONLINE), absl::Minutes(7));
  EXPECT_THAT(durations.Expected(known), Optional(absl::Minutes(15)));
  EXPECT_THAT(durations.Expected(MakeCell("hopper", "td3", Task::ONLINE)), Optional(absl::Minutes(11)));
  EXPECT_THAT(durations.Expected(MakeCell("walker", "dbr", Task::ONLINE)), Optional(absl::Minutes(10)));
  EXPECT_EQ(durations.Expected(MakeCell("walker", "dbr", Task::OFFLINE)), std::nullopt);
}

TEST(CellProgressTest, GoesByTheNearestLimit) {
  Config config;
  config.mutable_launch()->set_max_steps(1000);
  config.mutable_launch()->set_max_seconds(100);
  RunSummary summary;
  EXPECT_EQ(ProgressOf(config, summary).phase, "starting");
  EXPECT_EQ(ProgressOf(config, summary).left, std::nullopt);
  summary.ended = RunEnding::kRunning;
  summary.training_s = 20;
  summary.transitions = 500;
  CellProgress progress = ProgressOf(config, summary);
  EXPECT_EQ(progress.phase, "training");
  EXPECT_EQ(progress.amount, "500 of 1,000 steps");
  EXPECT_EQ(progress.fraction, 0.5);
  EXPECT_THAT(progress.left, Optional(absl::Seconds(20)));
  EXPECT_EQ(progress.newest, "");
  summary.training_s = 60;
  progress = ProgressOf(config, summary);
  EXPECT_EQ(progress.amount, "60 of 100 s");
  EXPECT_THAT(progress.left, Optional(absl::Seconds(40)));
}

TEST(CellProgressTest, TellsThePhaseAndTheNewestEvaluation) {
  Config config;
  config.mutable_learner()->set_offline_updates(100);
  config.mutable_learner()->set_max_updates(1000);
  RunSummary summary;
  summary.ended = RunEnding::kRunning;
  summary.updates = 50;
  EXPECT_EQ(ProgressOf(config, summary).phase, "offline");
  summary.updates = 100;
  EXPECT_EQ(ProgressOf(config, summary).phase, "online");
  summary.curve =
      EvaluationCurve({{.opponent = "", .return_mean = 1}, {.opponent = "", .return_mean = 812.34}});
  EXPECT_EQ(ProgressOf(config, summary).newest, "return 812.3");
  summary.curve = EvaluationCurve({{.opponent = "mcts:10", .score_mean = 0.625}});
  EXPECT_EQ(ProgressOf(config, summary).newest, "mcts:10 0.62");
  summary.ended = RunEnding::kMaxUpdates;
  EXPECT_EQ(ProgressOf(config, summary).phase, "evaluating");
  summary.ended = RunEnding::kInterrupted;
  EXPECT_EQ(ProgressOf(config, summary).phase, "saving");
}

GridStatus TwoRunning() {
  GridStatus state;
  state.running = {{"hopper-medium/dbr/seed-1",
                    {.phase = "training",
                     .amount = "12,000 of 30,000 updates",
                     .fraction = 0.4,
                     .newest = "return 812.3",
                     .left = absl::Seconds(90)}},
                   {"connect4/sac/seed-2", {.phase = "starting"}}};
  state.all = 45;
  state.done = 12;
  state.waiting = 31;
  return state;
}

TEST(StatusScreenTest, ShowsTheTotalsAndALineForEachRunningCell) {
  EXPECT_THAT(
      StatusLines(TwoRunning(), 120, 20),
      ElementsAre("12 of 45 done · 2 running · 31 waiting · time left not known yet",
                  "  hopper-medium/dbr/seed-1  training    ████▊         40%  12,000 of 30,000 updates · "
                  "return 812.3 · 1:30 left",
                  "  connect4/sac/seed-2       starting  "));
}

TEST(StatusScreenTest, CountsWhatWentWrongWhereSomethingDid) {
  GridStatus state = TwoRunning();
  state.failed = 1;
  state.left_alone = 2;
  state.left = absl::Hours(3);
  EXPECT_EQ(StatusTotals(state),
            "12 of 45 done · 2 running · 31 waiting · 1 failed · 2 left alone · 3:00:00 left");
}

TEST(StatusScreenTest, KeepsWithinTheTerminal) {
  GridStatus state = TwoRunning();
  for (int i = 0; i < 10; ++i) state.running.push_back(state.running[0]);
  const std::vector<std::string> lines = StatusLines(state, 40, 5);
  EXPECT_THAT(lines, SizeIs(5));
  EXPECT_EQ(lines.back(), "  and 9 more");
  for (const std::string& line : lines) EXPECT_LE(DisplayWidth(line), 40);
}

TEST(StatusScreenTest, WritesALineNowAndThenWhereThereIsNoTerminal) {
  std::FILE* file = std::tmpfile();
  const absl::Time start = absl::FromUnixSeconds(1000);
  {
    Output out(fileno(file));
    StatusScreen screen(&out, absl::Minutes(1));
    screen.Update(TwoRunning(), start);
    screen.Say("done x");
    screen.Update(TwoRunning(), start + absl::Seconds(59));
    screen.Update(TwoRunning(), start + absl::Seconds(61));
    screen.End();
  }
  std::rewind(file);
  std::string text(4096, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), file));
  std::fclose(file);
  const std::string line =
      "12 of 45 done · 2 running · 31 waiting · time left not known yet; hopper-medium/dbr/seed-1 training "
      "40%, "
      "connect4/sac/seed-2 starting 0%\n";
  EXPECT_EQ(text, line + "done x\n" + line);
}

}  // namespace
}  // namespace dbr
