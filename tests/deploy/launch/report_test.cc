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
#include "deploy/launch/summary_reader.h"
#include "deploy/terminal/terminal.h"
#include "envs/registry/registry.h"
#include "proto/config/experiment_file.h"
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

StatsReply SomeStats() {
  StatsReply stats;
  stats.set_total(100000);
  stats.set_plus(60000);
  stats.set_minus(41000);
  stats.set_capacity(300000);
  stats.set_bytes(80u << 20);
  stats.set_inserted(123456);
  stats.set_insert_rate(5120);
  stats.set_samples_per_insert(3.97);
  stats.set_episodes(12345);
  stats.set_recent_score_mean(kNaN);
  for (const double edge : {-1.0, 0.0, 1.0}) stats.add_advantage_edges(edge);
  for (const int count : {40000, 60000}) stats.add_advantage_histogram(count);
  WriterStats* writer = stats.add_writers();
  writer->set_name("actor-0");
  writer->set_inserted(123456);
  writer->set_last_sequence(123456);
  writer->set_held(100000);
  BlockedClients* blocked = stats.add_blocked();
  blocked->set_call("sample");
  blocked->set_clients(1);
  blocked->set_why("the rate limiter waits for inserts");
  LatencyStats* latency = stats.add_latencies();
  latency->set_call("sample");
  latency->set_count(10);
  latency->set_p50_us(250);
  latency->set_p99_us(1200);
  return stats;
}

LearnerStatus SomeStatus() {
  LearnerStatus status;
  status.set_updates(4000);
  status.set_matrix_products("a library, bfloat16");
  status.set_policy_version(82);
  status.set_updates_per_second(410);
  status.set_subscribers(2);
  status.set_oldest_subscriber_version(80);
  EvaluationReport* report = status.add_evaluations();
  report->set_opponent("random");
  report->set_score_mean(0.934);
  return status;
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

EvaluationResult Against(const std::string& opponent, double score) {
  return {.env = "connect4",
          .opponent = opponent,
          .episodes = 1000,
          .seed = 3,
          .score_mean = score,
          .score_stderr = 0.005,
          .return_mean = 2 * score - 1,
          .return_stderr = 0.01};
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

TEST(ResultsTest, SummaryKeepsItsCountersOverAResume) {
  TempDir folder;
  const RunFolder run{folder.path()};
  RunSummary summary;
  RunSample sample;
  sample.replay = SomeStats();
  sample.learner = SomeStatus();
  sample.reports = {sample.learner->evaluations(0)};
  summary.Update(sample);
  summary.missed_evaluations = 7;
  summary.ended = RunEnding::kInterrupted;
  summary.config = "bad \xff byte";
  summary.commit = "abc+changes";
  summary.training_s = 12.5;
  summary.launches = 2;
  summary.final_results = {Against("random", 0.9)};
  ASSERT_TRUE(WriteSummary(summary, run).ok());
  const Json json = Json::parse(*ReadFile(run.summary()));
  EXPECT_EQ(json["games"], 12345);
  EXPECT_EQ(json["updates"], 4000);
  EXPECT_EQ(json["evaluations"][0]["opponent"], "random");
  EXPECT_EQ(json["final"][0]["score"]["mean"], 0.9);
  const RunSummary read = ReadSummary(run);
  EXPECT_EQ(read.training_s, 12.5);
  EXPECT_EQ(read.launches, 2);
  EXPECT_EQ(read.transitions, 123456);
  EXPECT_EQ(read.missed_evaluations, 7);
  EXPECT_EQ(read.ended, RunEnding::kInterrupted);
  EXPECT_EQ(read.commit, "abc+changes");
  EXPECT_EQ(json["matrix_products"], "a library, bfloat16");
  EXPECT_EQ(read.matrix_products, "a library, bfloat16");
  ASSERT_EQ(read.final_results.size(), 1);
  EXPECT_EQ(ToJson(read.final_results[0]), ToJson(summary.final_results[0]));
}

TEST(ResultsTest, SummaryKeepsTheKernelsWhileALearnerDoesNotSayThemYet) {
  RunSummary summary;
  RunSample sample;
  sample.learner = SomeStatus();
  summary.Update(sample);
  sample.learner->clear_matrix_products();
  summary.Update(sample);
  EXPECT_EQ(summary.matrix_products, "a library, bfloat16");
}

TEST(ResultsTest, SummaryNamesTheIterationsThatWereNotEvaluated) {
  TempDir folder;
  const RunFolder run{folder.path()};
  RunSummary summary;
  summary.every_updates = 1000;
  summary.ended = RunEnding::kRunning;
  RunSample sample;
  sample.learner = SomeStatus();
  sample.learner->set_updates(9500);
  EvaluationReport report = sample.learner->evaluations(0);
  report.set_iteration(5);
  report.add_skipped_iterations(2);
  report.add_skipped_iterations(4);
  sample.reports = {report};
  summary.Update(sample);
  const auto written = [&] {
    EXPECT_TRUE(WriteSummary(summary, run).ok());
    return Json::parse(*ReadFile(run.summary()));
  };
  EXPECT_EQ(written()["skipped_iterations"], Json({2, 4}));
  // Those that it had not come to; of the policy of the last one is the final evaluation.
  summary.ended = RunEnding::kMaxUpdates;
  const Json json = written();
  EXPECT_EQ(json["skipped_iterations"], Json({2, 4, 6, 7, 8}));
  EXPECT_EQ(json["evaluations"][0]["iteration"], 5);
  EXPECT_EQ(*ReadSummary(run).curve.LastIteration(), 5);
  EXPECT_EQ(ReadSummary(run).SkippedIterations(), summary.SkippedIterations());
}

TEST(ResultsTest, ADamagedSummaryCountsAsNone) {
  TempDir folder;
  const RunFolder run{folder.path()};
  EXPECT_EQ(ReadSummary(run).launches, 0);
  ASSERT_TRUE(WriteFileAtomically(run.summary(), "{\"launches\": 3, ").ok());
  EXPECT_EQ(ReadSummary(run).launches, 0);
  ASSERT_TRUE(WriteFileAtomically(run.summary(), "{\"launches\": \"three\"}").ok());
  EXPECT_EQ(ReadSummary(run).launches, 0);
}

TEST(RunStateTest, TextsAreThoseOfTheSummary) {
  for (const char* text : {"running", "interrupted", "failed", "max_seconds", "max_episodes", "max_steps",
                           "max_updates", "stop_at_return"}) {
    const auto ending = ParseRunEnding(text);
    ASSERT_TRUE(ending.has_value()) << text;
    EXPECT_EQ(TextOf(*ending), text);
  }
  EXPECT_EQ(TextOf(RunEnding::kNone), "");
  EXPECT_FALSE(ParseRunEnding("max_minutes").has_value());
}

TEST(RunStateTest, AtALimitFinalResultsMakeARunDone) {
  RunSummary summary;
  EXPECT_EQ(StateOf(summary), RunState::kNotBegun);
  summary.ended = RunEnding::kMaxSteps;
  EXPECT_EQ(StateOf(summary), RunState::kInterrupted) << "in the final evaluation";
  summary.final_results = {Against("random", 0.9)};
  EXPECT_EQ(StateOf(summary), RunState::kDone);
  summary.ended = RunEnding::kFailed;
  EXPECT_EQ(StateOf(summary), RunState::kFailed);
}

TEST(ResultsTest, AnUnknownEndingIsDamageAndIsNamed) {
  TempDir folder;
  const RunFolder run{folder.path()};
  ASSERT_TRUE(WriteFileAtomically(run.summary(), "{\"ended\": \"max_minutes\"}").ok());
  const absl::Status status = LoadSummary(run).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("found \"max_minutes\""));
}

// What is wrong with it is printed, and printing goes as deep as the value.
TEST(ResultsTest, ASummaryThatIsNestedDeepIsDamage) {
  TempDir folder;
  const RunFolder run{folder.path()};
  const std::string deep = std::string(100000, '[') + std::string(100000, ']');
  ASSERT_TRUE(WriteFileAtomically(run.summary(), "{\"ended\": " + deep + "}").ok());
  const absl::Status status = LoadSummary(run).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("more than 64 deep"));
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
