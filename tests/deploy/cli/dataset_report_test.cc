#include "deploy/cli/dataset_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "deploy/terminal/progress_bar.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

DatasetReport SmallReport() {
  DatasetReport report;
  report.path = "data.hdf5";
  report.env = "hopper";
  report.layout = DatasetLayout::kD4rlPybullet;
  report.facts.rows = 12345;
  report.facts.transitions = 12000;
  report.facts.episodes = 30;
  report.facts.terminals = 20;
  report.facts.timeouts = 10;
  report.facts.bad_rows = 2;
  report.facts.bad_flags = 1;
  report.facts.return_mean = 1078.25;
  report.facts.return_std = 3.5;
  report.facts.return_min = -1;
  report.facts.return_max = 2000;
  return report;
}

TEST(DatasetReportTest, JsonHasTheNamedFieldsInOrder) {
  EXPECT_EQ(
      DatasetJson(SmallReport()).dump(),
      R"({"layout":"d4rl_pybullet","rows":12345,"transitions":12000,"episodes":30,"terminals":20,"timeouts":10,)"
      R"("non_finite":2,"bad_flags":1,"return":{"mean":1078.25,"std":3.5,"min":-1.0,"max":2000.0},)"
      R"("actions_outside":0,"warnings":[]})");
}

TEST(DatasetReportTest, DrawsTheDistributionOfTheReturns) {
  DatasetReport report = SmallReport();
  report.facts.return_min = 0;
  report.facts.return_max = 40;
  report.facts.returns = {0, 1, 2, 3, 4, 5, 6, 7, 10, 12, 14, 19.9f, 30, 31, 39, 40};  // 16: 4 lines
  const std::string text = DatasetText(report);
  const auto line = [](const char* name, const char* from, double share, const char* count) {
    return absl::StrCat("  ", PadRight(name, 13), PadLeft(from, 9), "  ", Bar(share, 30), PadLeft(count, 9),
                        "\n");
  };
  EXPECT_THAT(text, HasSubstr(absl::StrCat(line("returns from", "0.0", 1, "8"), line("", "10.0", 0.5, "4"),
                                           line("", "20.0", 0, "0"), line("", "30.0", 0.5, "4"))))
      << text;
  report.facts.returns.assign(5000, 3);
  report.facts.return_min = report.facts.return_max = 3;
  EXPECT_THAT(DatasetText(report), Not(HasSubstr("returns from"))) << "one line would say nothing";
  EXPECT_THAT(DatasetText(SmallReport()), Not(HasSubstr("returns from")));
}

TEST(DatasetReportTest, JsonWithoutEpisodesHasNoReturns) {
  const nlohmann::ordered_json json = nlohmann::ordered_json::parse(DatasetJson(DatasetReport()).dump());
  EXPECT_TRUE(json["return"]["mean"].is_null());
  EXPECT_EQ(json["episodes"], 0);
}

TEST(DatasetReportTest, WarnsWhereNoEpisodeEnds) {
  DatasetReport report;
  EXPECT_THAT(DatasetText(report), Not(HasSubstr("warning"))) << "an empty file has nothing to warn of";
  report.facts.transitions = 402;
  EXPECT_THAT(DatasetText(report), HasSubstr("warning      no episode ends in the file"));
  EXPECT_THAT(DatasetJson(report)["warnings"][0].get<std::string>(), HasSubstr("no episode ends"));
  report.facts.episodes = 1;
  EXPECT_THAT(DatasetText(report), Not(HasSubstr("warning")));
}

TEST(DatasetReportTest, WarnsOfActionsOutsideTheRange) {
  DatasetReport report = SmallReport();
  report.facts.actions_outside = 17;
  EXPECT_THAT(DatasetText(report), HasSubstr("warning      17 rows have actions outside [-1, 1]"));
  EXPECT_EQ(DatasetJson(report)["actions_outside"], 17);
  EXPECT_EQ(DatasetJson(report)["warnings"].size(), 1u);
}

TEST(DatasetReportTest, TextSaysItForPeople) {
  EXPECT_THAT(DatasetText(SmallReport()),
              AllOf(HasSubstr("d4rl_pybullet"), HasSubstr("hopper"), HasSubstr("12,345"),
                    HasSubstr("30 (20 ended by a terminal, 10 by the time limit)"),
                    HasSubstr("1078.2 ± 3.5 (from -1.0 to 2000.0)"), HasSubstr("bad rows     2 (")));
}

TEST(ProgressBarTest, SaysHowFarHowFastAndHowLong) {
  const BarState state{.label = "hopper random",
                       .unit = "steps",
                       .done = 450000,
                       .total = 1000000,
                       .elapsed = absl::Seconds(45)};
  EXPECT_EQ(BarText(state, 200),
            "hopper random  █████████            45%  450k of 1.0M steps · 10k steps/s · 0:55 left");
  EXPECT_EQ(DisplayWidth(BarText(state, 40)), 40);
}

TEST(ProgressBarTest, StartsWithoutARate) {
  const BarState state{.label = "x", .unit = "rows", .done = 0, .total = 10, .elapsed = absl::ZeroDuration()};
  EXPECT_THAT(BarText(state, 200), HasSubstr("0%  0 of 10 rows · 0 rows/s"));
}

}  // namespace
}  // namespace dbr
