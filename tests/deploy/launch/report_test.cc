// What people and programs read: the progress line, the tables, the figures and their JSON.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "deploy/cli/stats_report.h"
#include "deploy/launch/progress.h"
#include "deploy/launch/result_tables.h"
#include "deploy/launch/results.h"
#include "deploy/terminal/terminal.h"
#include "envs/registry/registry.h"
#include "proto/config/experiment_file.h"
#include "tests/deploy/launch/some_answers.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAreArray;
using Json = nlohmann::ordered_json;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(TerminalTest, WritesNumbersForPeople) {
  EXPECT_EQ(WithCommas(0), "0");
  EXPECT_EQ(WithCommas(999), "999");
  EXPECT_EQ(WithCommas(1234567), "1,234,567");
  EXPECT_EQ(Compact(999), "999");
  EXPECT_EQ(Compact(1000), "1.0k");
  EXPECT_EQ(Compact(45678), "46k");
  EXPECT_EQ(Compact(999600), "1.0M");
  EXPECT_EQ(Compact(kNaN), "–");
  EXPECT_EQ(Bytes(1023), "1023 B");
  EXPECT_EQ(Bytes(1536), "1.5 KiB");
  EXPECT_EQ(Bytes(300u << 20), "300 MiB");
  EXPECT_EQ(Clock(absl::Seconds(61.2)), "1:02");
  EXPECT_EQ(Clock(absl::Seconds(3723)), "1:02:03");
  EXPECT_EQ(Clock(-absl::Seconds(5)), "0:00");
  EXPECT_EQ(Fixed(kNaN, 2), "–");
  EXPECT_EQ(Fixed(0.125, 2), "0.12");
}

TEST(TerminalTest, DrawsBarsOfOneWidth) {
  EXPECT_EQ(Bar(0.5, 4), "██  ");
  EXPECT_EQ(Bar(1.0 / 32, 4), "▏   ");
  EXPECT_EQ(Bar(2, 4), "████");
  EXPECT_EQ(Bar(-1, 4), "    ");
  EXPECT_EQ(Bar(kNaN, 4), "    ");
  for (int i = 0; i <= 100; ++i) EXPECT_EQ(DisplayWidth(Bar(i / 100.0, 7)), 7);
  EXPECT_EQ(Spark(0), " ");
  EXPECT_EQ(Spark(1e-9), "▁");
  EXPECT_EQ(Spark(1), "█");
}

TEST(TerminalTest, CutsBetweenCharacters) {
  EXPECT_EQ(Truncate("a–b", 2), "a–");
  EXPECT_EQ(Truncate("ab", 5), "ab");
  EXPECT_EQ(PadLeft("–", 3), "  –");
}

Progress OfConnect4() {
  Progress progress;
  progress.presentation = PresentationOf("connect4");
  return progress;
}

TEST(ProgressTest, SaysEverythingInOneLine) {
  Progress progress = OfConnect4();
  progress.sample.replay = SomeStats();
  progress.sample.learner = SomeStatus();
  progress.left = absl::Seconds(125);
  const std::string line = ProgressText(progress, 200);
  for (const char* part : {"12,345 games", "5.1k transitions/s", "410 updates/s", "D 100k", "D+ 60k",
                           "D- 41k", "policy 82 (lag 2)", "random 0.93", "2:05 left"}) {
    EXPECT_THAT(line, HasSubstr(part));
  }
}

TEST(ProgressTest, FitsATerminalOfEightyColumns) {
  Progress progress = OfConnect4();
  progress.sample.replay = SomeStats();
  progress.sample.learner = SomeStatus();
  progress.left = absl::Seconds(125);
  const std::string line = ProgressText(progress, 79);
  EXPECT_LE(DisplayWidth(line), 79);
  for (const char* part : {"12k games", "+60k", "v82 lag 2", "rnd .93", "2:05"})
    EXPECT_THAT(line, HasSubstr(part));
  EXPECT_LE(DisplayWidth(ProgressText(progress, 30)), 30);
}

TEST(ProgressTest, ShowsTheWatchedOpponentsThatAreEvaluated) {
  Progress progress = OfConnect4();
  EXPECT_THAT(ProgressText(progress, 200), AllOf(HasSubstr("random –"), HasSubstr("mcts:10 –")));
  progress.sample.learner = SomeStatus();
  EXPECT_THAT(ProgressText(progress, 200), AllOf(HasSubstr("random 0.93"), Not(HasSubstr("mcts:10"))));
}

TEST(ProgressTest, ShowsWhatIsEvaluatedWhereNoneOfItIsWatched) {
  Progress progress = OfConnect4();
  progress.sample.replay = SomeStats();
  progress.sample.learner = SomeStatus();
  progress.left = absl::Seconds(125);
  progress.sample.learner->mutable_evaluations(0)->set_opponent("one_ply");
  const std::string line = ProgressText(progress, 200);
  EXPECT_THAT(line, HasSubstr("(lag 2) · one_ply 0.93 · 2:05 left"));
  EXPECT_THAT(ProgressText(progress, 79), AllOf(HasSubstr("one_ply .93"), Not(HasSubstr("  "))));
}

TEST(ProgressTest, SaysThatAServiceIsAway) {
  Progress progress = OfConnect4();
  progress.sample.replay = SomeStats();
  progress.sample.replay_away = true;
  EXPECT_THAT(ProgressText(progress, 200), AllOf(HasSubstr("replay away"), HasSubstr("lag –")));
}

TEST(ProgressTest, WritesALineNowAndThenWhereThereIsNoTerminal) {
  TempDir folder;
  std::FILE* file = std::fopen((folder / "out").c_str(), "w");
  {
    Output out(fileno(file));
    ProgressLine line(&out, absl::Seconds(10));
    const absl::Time start = absl::FromUnixSeconds(1000);
    for (int second = 0; second <= 20; ++second) line.Update({}, start + absl::Seconds(second));
    line.Say("a word");
  }
  std::fclose(file);
  const std::string text = *ReadFile(folder / "out");
  EXPECT_THAT(text, Not(HasSubstr("\r")));
  const std::vector<std::string> lines = absl::StrSplit(text, '\n', absl::SkipEmpty());
  ASSERT_EQ(lines.size(), 4);
  EXPECT_EQ(lines[3], "a word");
}

TEST(ResultsTest, TableHasThePaperBesideTheScores) {
  const std::string table = ResultTable({Against("random", 0.971), Against("one_ply", 0.5)});
  const std::vector<std::string> lines = absl::StrSplit(table, '\n');
  EXPECT_THAT(lines[1], AllOf(HasSubstr("random"), HasSubstr("1,000"), HasSubstr("0.971 ± 0.005"),
                              HasSubstr("0.982 ± 0.016"), HasSubstr("0.967"), HasSubstr("0.589")));
  EXPECT_THAT(lines[2], AllOf(HasSubstr("one_ply"), HasSubstr("0.500"), Not(HasSubstr("0.982"))));
  EXPECT_EQ(lines[0],
            " opponent      games      score ± s.e. │       paper: DBR             BEAR       Double DQN");
  EXPECT_EQ(lines[3],
            " A win counts 1, a draw 0.5; each side starts half of the games. The paper's ± is the standard "
            "deviation.");
  EXPECT_EQ(DisplayWidth(lines[0]), DisplayWidth(lines[1]));
  EXPECT_EQ(DisplayWidth(lines[1]), DisplayWidth(lines[2]));
}

// As text, since they were printed so: a line for each opponent and algorithm.
std::vector<std::string> PublishedScores(const EnvPresentation& presentation) {
  std::vector<std::string> scores;
  for (const PublishedColumn& column : presentation.published) {
    for (const PublishedScore& score : column.scores)
      scores.push_back(absl::StrCat(score.opponent, " ", column.algorithm, " (", column.label, ") ",
                                    score.mean, " ± ", score.std));
  }
  return scores;
}

TEST(ResultsTest, ThePublishedScoresAreThoseOfThePapersGrid) {
  const auto grid = LoadExperiment(DBR_SOURCE_DIR "/deploy/experiments/paper.textproto");
  ASSERT_TRUE(grid.ok()) << grid.status();
  std::map<std::string, std::string> labels;
  for (const Contender& contender : grid->contender()) labels[contender.name()] = contender.label();
  for (const std::string& env : EnvNames()) {
    std::vector<std::string> scores;
    for (const Task& task : grid->task()) {
      if (task.kind() != Task::GAMES || task.config().env().name() != env) continue;
      for (const Measure& measure : task.measure()) {
        for (const Published& one : measure.published())
          scores.push_back(absl::StrCat(measure.opponent(), " ", one.contender(), " (",
                                        labels[one.contender()], ") ", one.mean(), " ± ", one.std()));
      }
    }
    EXPECT_THAT(PublishedScores(PresentationOf(env)), UnorderedElementsAreArray(scores)) << env;
    EXPECT_EQ(scores.size(), env == "connect4" ? 6 : 0);
  }
}

TEST(ResultsTest, JsonHasItsStableNames) {
  EXPECT_EQ(ToJson(Against("mcts:10", 0.75)).dump(),
            R"({"env":"connect4","opponent":"mcts:10","episodes":1000,"seed":3,)"
            R"("score":{"mean":0.75,"stderr":0.005},"return":{"mean":0.5,"stderr":0.01}})");
  EXPECT_TRUE(ToJson(Against("", kNaN))["score"]["mean"].is_null());
}

TEST(StatsReportTest, TextShowsEverything) {
  const std::string text = StatsText("unix:run/replay.sock", SomeStats());
  for (const char* part :
       {"unix:run/replay.sock", "100,000", "33% of 300,000", "60% of D", "80.0 MiB", "123,456", "5.1k/s",
        "3.97 samples per insert", "actor-0", "1 client waits to sample: the rate limiter waits", "250 us",
        "1.2 ms", "advantages", "score –"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
}

TEST(StatsReportTest, JsonHasItsStableNames) {
  const Json json = ToJson(SomeStats());
  for (const char* name :
       {"total", "plus", "minus", "unjudged", "inserted", "sampled", "evicted", "relabelled", "insert_rate",
        "samples_per_insert", "label_age_mean", "label_age_p95", "bytes"}) {
    EXPECT_TRUE(json.contains(name) && json[name].is_number()) << name;
  }
  EXPECT_EQ(json["total"], 100000);
  EXPECT_EQ(json["plus"], 60000);
  EXPECT_EQ(json["advantage_histogram"], Json::parse("[40000, 60000]"));
  EXPECT_EQ(json["writers"][0]["name"], "actor-0");
  EXPECT_EQ(json["writers"][0]["share"], 1.0);
  EXPECT_EQ(json["sources"]["online"]["total"], 100000);
  EXPECT_EQ(json["blocked"][0]["why"], "the rate limiter waits for inserts");
  EXPECT_EQ(json["latencies"][0]["p99_us"], 1200);
  EXPECT_TRUE(json["recent_score_mean"].is_null());
}

}  // namespace
}  // namespace dbr
