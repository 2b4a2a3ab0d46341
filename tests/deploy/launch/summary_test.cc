// Tests the summary of a run: its counters over resumes, its endings, and damaged files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "core/file_io.h"
#include "deploy/launch/results.h"
#include "deploy/launch/summary_reader.h"
#include "tests/deploy/launch/some_answers.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::ordered_json;

TEST(SummaryTest, KeepsItsCountersOverAResume) {
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
  summary.final_policy = "average";
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
  EXPECT_EQ(json["policy"], "average");
  EXPECT_EQ(read.final_policy, "average");
  ASSERT_EQ(read.final_results.size(), 1);
  EXPECT_EQ(ToJson(read.final_results[0]), ToJson(summary.final_results[0]));
}

TEST(SummaryTest, KeepsTheKernelsWhileALearnerDoesNotSayThemYet) {
  RunSummary summary;
  RunSample sample;
  sample.learner = SomeStatus();
  summary.Update(sample);
  sample.learner->clear_matrix_products();
  summary.Update(sample);
  EXPECT_EQ(summary.matrix_products, "a library, bfloat16");
}

TEST(SummaryTest, NamesTheIterationsThatWereNotEvaluated) {
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

TEST(SummaryTest, ADamagedOneCountsAsNone) {
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

TEST(SummaryTest, AnUnknownEndingIsDamageAndIsNamed) {
  TempDir folder;
  const RunFolder run{folder.path()};
  ASSERT_TRUE(WriteFileAtomically(run.summary(), "{\"ended\": \"max_minutes\"}").ok());
  const absl::Status status = LoadSummary(run).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("found \"max_minutes\""));
}

// What is wrong with it is printed, and printing goes as deep as the value.
TEST(SummaryTest, OneThatIsNestedDeepIsDamage) {
  TempDir folder;
  const RunFolder run{folder.path()};
  const std::string deep = std::string(100000, '[') + std::string(100000, ']');
  ASSERT_TRUE(WriteFileAtomically(run.summary(), "{\"ended\": " + deep + "}").ok());
  const absl::Status status = LoadSummary(run).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("more than 64 deep"));
}

}  // namespace
}  // namespace dbr
