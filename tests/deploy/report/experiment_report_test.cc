// The report over an experiment's folders: what its tables say, what its pictures hold, and what it does
// about cells that are not done.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "deploy/report/cells.h"
#include "deploy/report/report.h"
#include "tests/deploy/report/fake_experiment.h"
#include "tests/support/temp_dir.h"

namespace dbr::report {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

// Two seeds of everything but BEAR on hopper-medium: one done, one running.
void WriteFakeRuns(const std::string& root) {
  WriteFakeExperiment(root);
  for (const int seed : {1, 2}) {
    WriteFakeCell(root, "hopper-medium", "dbr", FakeHopper(1100 + 20 * seed, seed));
    WriteFakeCell(root, "hopper-medium", "dbr-fixed", FakeHopper(900 + 20 * seed, seed));
    WriteFakeCell(root, "connect4", "dbr", FakeGames(0.98 + 0.001 * seed, 0.9 + 0.01 * seed, seed));
    WriteFakeCell(root, "connect4", "bear", FakeGames(0.96, 0.75, seed));
  }
  WriteFakeCell(root, "hopper-medium", "bear", FakeHopper(1000, 1));
  RunSummary running = FakeHopper(777, 2);
  running.ended = RunEnding::kRunning;
  running.final_results.clear();
  WriteFakeCell(root, "hopper-medium", "bear", running);
}

// The line of the Markdown table that begins so.
std::string LineOf(const std::string& markdown, const std::string& start) {
  for (const absl::string_view line : absl::StrSplit(markdown, '\n')) {
    if (absl::StartsWith(line, start)) return std::string(line);
  }
  return "";
}

class ReportTest : public testing::Test {
 protected:
  // Writes the report and gives what came of it.
  ReportOutcome Write() {
    const absl::StatusOr<ReportOutcome> outcome =
        WriteReport({.runs = {folder_ / "runs"}, .grid = "", .out = folder_ / "out"});
    EXPECT_TRUE(outcome.ok()) << outcome.status();
    return outcome.value_or(ReportOutcome{});
  }
  std::string Output(const std::string& name) { return ReadFile(folder_ / ("out/" + name)).value_or(""); }

  TempDir folder_;
};

TEST_F(ReportTest, PutsOursBesideThePublishedFigures) {
  WriteFakeRuns(folder_ / "runs");
  Write();
  const std::string text = Output("report.md");
  EXPECT_EQ(LineOf(text, "| task |"), "| task |  | DBR | BEAR |");
  EXPECT_EQ(LineOf(text, "| Hopper (offline, medium) |"),
            "| Hopper (offline, medium) | published | 17.3 ± 6 | 16.1 ± 2.97 |");
  // 1120 and 1140; of BEAR one seed, which has no spread.
  EXPECT_THAT(text, HasSubstr("|  | ours | **1130.0 ± 14.1** | 1000.0 (one seed) |"));
  EXPECT_THAT(text, HasSubstr("|  | IQM \\[95%] | 1130.0 \\[1120.0, 1140.0] | – |"));
  EXPECT_THAT(text, HasSubstr("|  | seeds | 2 | 1 of 2: 1 running |"));
  EXPECT_THAT(text, HasSubstr("| Connect 4 - random | published | 0.982 ± 0.0158 | – |"));
  EXPECT_THAT(text, HasSubstr("|  | ours | **0.982 ± 0.001** | 0.960 ± 0.000 |"));
  EXPECT_THAT(text, HasSubstr("| Connect 4 - MCTS 10 | ours | **0.915 ± 0.007** | 0.750 ± 0.000 |"));
}

TEST_F(ReportTest, TakesScoresTogetherButNoReturns) {
  WriteFakeRuns(folder_ / "runs");
  Write();
  const std::string text = Output("report.md");
  // A run's value is the mean of its two scores: 0.9455 and 0.951.
  EXPECT_THAT(text,
              HasSubstr("| All scores | IQM \\[95%] | 0.948 \\[0.946, 0.951] | 0.855 \\[0.855, 0.855] |"));
}

TEST_F(ReportTest, NamesCellsThatAreNotDoneAndGivesNoFiguresOfThem) {
  WriteFakeExperiment(folder_ / "runs");
  RunSummary failed = FakeHopper(777, 1), running = FakeHopper(888, 2);
  failed.ended = RunEnding::kFailed;
  failed.failure = "the learner died 6 times";
  running.ended = RunEnding::kRunning;
  WriteFakeCell(folder_ / "runs", "hopper-medium", "dbr", failed);
  WriteFakeCell(folder_ / "runs", "hopper-medium", "dbr", running);
  EXPECT_EQ(Write().counts, "0 of 10 cells done, 1 running, 1 failed, 8 not run");
  const std::string text = Output("report.md");
  EXPECT_THAT(text, HasSubstr("|  | ours | 1 failed, 1 running | 2 not run |"));
  EXPECT_THAT(text, HasSubstr("hopper-medium, dbr, seed 1: the learner died 6 times"));
  EXPECT_THAT(text, Not(AnyOf(HasSubstr("777"), HasSubstr("888"))));
  EXPECT_THAT(text, HasSubstr("Nothing to draw yet"));
}

TEST_F(ReportTest, ADamagedSummaryIsNamedAndTheOthersAreReported) {
  WriteFakeRuns(folder_ / "runs");
  const std::string path = folder_ / "runs/hopper-medium/dbr/seed-2/summary.json";
  ASSERT_TRUE(WriteFileAtomically(path, "{\"env\": \"hop").ok());
  EXPECT_THAT(Write().notes, Contains(AllOf(HasSubstr(path), HasSubstr("no JSON"))));
  const std::string text = Output("report.md");
  EXPECT_THAT(text, HasSubstr("| **1120.0 (one seed)** |"));
  EXPECT_THAT(text, HasSubstr("1 of 2: 1 failed"));
}

TEST_F(ReportTest, ListsEveryCellWithCommitTimeAndSettings) {
  WriteFakeRuns(folder_ / "runs");
  Write();
  const std::string text = Output("report.md");
  EXPECT_THAT(LineOf(text, "| hopper-medium | dbr | 1 |"),
              ContainsRegex("done . max_updates . 0123456789ab . 1:02:03 . 30,000 . 0 . 0 . [0-9a-f]{8} . a "
                            "library, float32 . average "));
  EXPECT_THAT(text, HasSubstr("|  | bear | 2 | running |"));
  EXPECT_THAT(text, HasSubstr("learner.max_updates: 30000\n"));
  EXPECT_THAT(text, HasSubstr("algorithm.dbr.constraint: FIXED\n"));
  EXPECT_THAT(text, Not(HasSubstr("algorithm.dbr.divergence")));  // at its default
}

TEST_F(ReportTest, ACellThatTwoFoldersHoldCountsOnce) {
  WriteFakeRuns(folder_ / "runs");
  WriteFakeExperiment(folder_ / "more");
  WriteFakeCell(folder_ / "more", "hopper-medium", "bear", FakeHopper(1040, 2));
  const auto runs = LoadRuns({folder_ / "runs", folder_ / "more"}, "");
  ASSERT_TRUE(runs.ok()) << runs.status();
  EXPECT_EQ(runs->cells.size(), 10);
  EXPECT_THAT(runs->notes, ElementsAre(HasSubstr("holds the same cell")));
  for (const ReportedCell& cell : runs->cells) EXPECT_EQ(cell.state, ReportedState::kDone);
}

TEST_F(ReportTest, SaysWhereSeedsOfSeveralConfigsOrScalesAreTakenTogether) {
  WriteFakeRuns(folder_ / "runs");
  ASSERT_TRUE(WriteFileAtomically(folder_ / "runs/hopper-medium/dbr/seed-2/config.textproto",
                                  "learner { max_updates: 7 }")
                  .ok());
  WriteFakeExperiment(folder_ / "more");
  ASSERT_TRUE(WriteFileAtomically(folder_ / "more/scale.txt", "paper\n").ok());
  const auto runs = LoadRuns({folder_ / "runs", folder_ / "more"}, "");
  ASSERT_TRUE(runs.ok()) << runs.status();
  EXPECT_EQ(runs->scale, "short");
  EXPECT_THAT(runs->notes,
              ElementsAre(AllOf(HasSubstr("/more: of scale paper"), HasSubstr("runs of scale short")),
                          HasSubstr("hopper-medium/dbr: seeds of 2 configs are averaged")));
}

TEST_F(ReportTest, SaysWhichFoldersTheGridDoesNotKnow) {
  WriteFakeExperiment(folder_ / "runs");
  WriteFakeCell(folder_ / "runs", "swimmer", "dbr", FakeHopper(1, 1));
  WriteFakeCell(folder_ / "runs", "hopper-medium", "ppo", FakeHopper(1, 1));
  std::filesystem::create_directories(folder_ / "runs/report/plots");  // of no run
  EXPECT_THAT(Write().notes,
              UnorderedElementsAre(HasSubstr("swimmer/dbr: left out"), HasSubstr("ppo: left out")));
}

TEST_F(ReportTest, RefusesAFolderThatHoldsNoExperiment) {
  std::filesystem::create_directories(folder_ / "empty");
  const auto empty = WriteReport({.runs = {folder_ / "empty"}, .grid = "", .out = folder_ / "out"});
  EXPECT_EQ(empty.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(empty.status().message()), HasSubstr("without experiment.textproto"));
  const auto none = WriteReport({.runs = {folder_ / "nowhere"}, .grid = "", .out = folder_ / "out"});
  EXPECT_THAT(std::string(none.status().message()), HasSubstr("which is no folder"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

TEST_F(ReportTest, AnotherGridMayTakeThePlaceOfTheRunsOwn) {
  WriteFakeRuns(folder_ / "runs");
  std::filesystem::remove(folder_ / "runs/experiment.textproto");
  std::string grid = FakeGrid();
  grid.replace(grid.find("DBR"), 3, "Ours");
  ASSERT_TRUE(WriteFileAtomically(folder_ / "grid.textproto", grid).ok());
  const auto outcome =
      WriteReport({.runs = {folder_ / "runs"}, .grid = folder_ / "grid.textproto", .out = folder_ / "out"});
  ASSERT_TRUE(outcome.ok()) << outcome.status();
  EXPECT_THAT(Output("report.md"), HasSubstr("| task |  | Ours | BEAR |"));
}

TEST_F(ReportTest, SaysWhereItCannotWrite) {
  WriteFakeRuns(folder_ / "runs");
  ASSERT_TRUE(WriteFileAtomically(folder_ / "file", "").ok());
  const auto outcome = WriteReport({.runs = {folder_ / "runs"}, .grid = "", .out = folder_ / "file/out"});
  EXPECT_THAT(std::string(outcome.status().message()),
              AllOf(HasSubstr("--out"), HasSubstr(folder_ / "file/out")));
}

TEST_F(ReportTest, ThePageNeedsNoOtherFile) {
  WriteFakeRuns(folder_ / "runs");
  Write();
  const std::string page = Output("report.html");
  EXPECT_THAT(page, HasSubstr("ARM &lt;fixed&gt;"));
  for (const char* attribute :
       {"src=", "<script", "<link", "@import", "href=\"http", "href='http", "url(http"})
    EXPECT_THAT(page, Not(HasSubstr(attribute)));
}

TEST_F(ReportTest, PicturesHoldTheirLabels) {
  WriteFakeRuns(folder_ / "runs");
  const absl::Status plots = Write().plots;
  ASSERT_TRUE(plots.ok()) << plots;
  EXPECT_THAT(Output("plots/curves-hopper-medium.svg"),
              AllOf(HasSubstr("Hopper (offline, medium)"), HasSubstr("gradient updates"),
                    HasSubstr("return of an episode"), HasSubstr("DBR"), HasSubstr("mean of the data"),
                    HasSubstr("fill-opacity")));
  EXPECT_THAT(Output("plots/curves-connect4-mcts-10.svg"), HasSubstr("score (win 1, draw 0.5)"));
  EXPECT_THAT(Output("plots/bars-offline--medium-data.svg"),
              AllOf(HasSubstr("published"), HasSubstr("BEAR")));
  EXPECT_THAT(Output("plots/ablations-dbr.svg"),
              AllOf(HasSubstr("ARM &lt;fixed>"), HasSubstr("95% interval")));
  EXPECT_THAT(Output("plots/ablation-curves-dbr-hopper-medium.svg"), HasSubstr("DBR"));
  EXPECT_THAT(Output("plots/board.svg"), HasSubstr("column 7 must be blocked"));
  const std::string page = Output("report.html"), text = Output("report.md");
  for (const char* name : {"curves-hopper-medium", "ablations-dbr", "board"})
    EXPECT_THAT(text, HasSubstr(absl::StrCat("](plots/", name, ".svg)")));
  std::vector<std::string> svgs = absl::StrSplit(page, "<svg");
  EXPECT_EQ(svgs.size() - 1, 8);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/plots.gp"));
}

TEST_F(ReportTest, WithoutGnuplotTheRestIsWholeAndSaysWhatToInstall) {
  WriteFakeRuns(folder_ / "runs");
  const std::string path = std::getenv("PATH");
  setenv("PATH", (folder_ / "nowhere").c_str(), 1);
  const absl::Status plots = Write().plots;
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(plots.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(plots.message()), HasSubstr("apt-get install gnuplot-nox"));
  EXPECT_THAT(Output("report.md"),
              AllOf(HasSubstr("1130.0 ± 14.1"), HasSubstr("not drawn"), HasSubstr("gnuplot-nox")));
}

}  // namespace
}  // namespace dbr::report
