// The parts of the report that can be asked alone: curves, gnuplot's scripts, the board, settings.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "deploy/process/gnuplot.h"
#include "deploy/report/board_figure.h"
#include "deploy/report/curves.h"
#include "deploy/report/document.h"
#include "deploy/report/plot_script.h"
#include "deploy/report/settings.h"
#include "envs/connect4/board.h"
#include "nn/mlp.h"
#include "tests/support/temp_dir.h"

namespace dbr::report {
namespace {

using connect4::Board;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

ReportedCell Finished(std::vector<EvaluationPoint> points) {
  ReportedCell cell;
  cell.state = ReportedState::kDone;
  cell.summary.curve = EvaluationCurve(std::move(points));
  return cell;
}

EvaluationPoint At(std::uint64_t updates, double value) {
  EvaluationPoint point;
  point.updates = updates;
  point.steps = 10 * updates;
  point.return_mean = value;
  return point;
}

TEST(CurveTest, IsTakenOverTheStretchThatAllSeedsShare) {
  Runs runs;
  runs.cells = {Finished({At(0, 0), At(100, 10), At(200, 20)}),
                Finished({At(100, 20), At(200, 40), At(300, 60)})};
  const Curve curve = MakeCurve(runs, 0, 0, "", Axis::kUpdates);
  EXPECT_EQ(curve.seeds, 2);
  EXPECT_THAT(curve.x, ElementsAre(100, 150, 200));
  EXPECT_THAT(curve.mean, ElementsAre(15, 22.5, 30));
  EXPECT_THAT(curve.low, ElementsAre(10, 15, 20));
  EXPECT_THAT(curve.high, ElementsAre(20, 30, 40));
  EXPECT_THAT(MakeCurve(runs, 0, 0, "", Axis::kSteps).x, ElementsAre(1000, 1500, 2000));
}

TEST(CurveTest, WhatALearnerThatGoesBackMakesAgainTakesThePlaceOfWhatWasThere) {
  Runs runs;
  runs.cells = {Finished({At(100, 10), At(200, 20), At(300, 30), At(150, 15), At(200, 21)})};
  const Curve curve = MakeCurve(runs, 0, 0, "", Axis::kUpdates);
  EXPECT_EQ(curve.x.back(), 200) << "300 was never reached again";
  EXPECT_EQ(curve.mean.front(), 10);
  EXPECT_EQ(curve.mean.back(), 21);
}

TEST(CurveTest, LeavesOutOtherOpponentsAndRunsThatAreNotDone) {
  Runs runs;
  EvaluationPoint other = At(100, 99);
  other.opponent = "mcts:10";
  EvaluationPoint random = At(100, 1);
  random.opponent = "random";
  runs.cells = {Finished({random, other}), Finished({other})};
  runs.cells[1].state = ReportedState::kRunning;
  EXPECT_THAT(MakeCurve(runs, 0, 0, "random", Axis::kUpdates).mean, ElementsAre(1));
  EXPECT_THAT(MakeCurve(runs, 0, 0, "one_ply", Axis::kUpdates).x, IsEmpty());
  EXPECT_THAT(MakeCurve(runs, 1, 0, "", Axis::kUpdates).x, IsEmpty());
}

TEST(CurveTest, ALongRunIsReadOffAtAFixedNumberOfPlaces) {
  std::vector<EvaluationPoint> points;
  for (int i = 0; i <= 1000; ++i) points.push_back(At(1000 * i, i));
  Runs runs;
  runs.cells = {Finished(std::move(points))};
  const Curve curve = MakeCurve(runs, 0, 0, "", Axis::kUpdates);
  EXPECT_THAT(curve.x, SizeIs(kPoints));
  EXPECT_EQ(curve.mean.front(), 0);
  EXPECT_EQ(curve.mean.back(), 1000);
}

// A curve of two places.
CurvePlot PlotOf(const std::string& title, int seeds) {
  CurvePlot plot;
  plot.file = "x.svg";
  plot.title = title;
  plot.lines = {{"a_b", 0, {{1, 2}, {1, 2}, {0, 1}, {2, 3}, seeds}}};
  return plot;
}

BarPlot PlotOf(const std::optional<Estimate>& ours) {
  BarPlot plot;
  plot.file = "x.svg";
  plot.panels = {{"Hopper", "return", {{"DBR", std::nullopt, ours}}}};
  return plot;
}

TEST(PlotScriptTest, LabelsAreTextWhateverTheyHold) {
  EXPECT_THAT(Script(PlotOf("it's `date`\nset output 'y'", 2)),
              HasSubstr("set title 'it''s `date` set output ''y'''"));
}

TEST(PlotScriptTest, ThereIsNoPlotOfNothing) {
  CurvePlot plot = PlotOf("a", 2);
  plot.lines[0].curve = Curve();
  EXPECT_EQ(Script(plot), "");
  EXPECT_EQ(Script(PlotOf(std::nullopt)), "");
}

TEST(PlotScriptTest, OneSeedHasNeitherBandNorWhisker) {
  EXPECT_THAT(Script(PlotOf("a", 2)), HasSubstr("filledcurves"));
  EXPECT_THAT(Script(PlotOf("a", 1)), Not(HasSubstr("filledcurves")));
  EXPECT_THAT(Script(PlotOf(Estimate{.value = 3, .low = 2, .high = 4})), HasSubstr("with vectors"));
  EXPECT_THAT(Script(PlotOf(Estimate{.value = 3})),
              AllOf(HasSubstr("with boxes"), Not(HasSubstr("with vectors"))));
}

TEST(GnuplotTest, AScriptThatFailsIsReportedWithItsLastWords) {
  TempDir folder;
  const absl::Status status = RunGnuplot("plot nonsense(", folder.path(), absl::Minutes(1));
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("plots.gp"), HasSubstr("nonsense")));
}

TEST(GnuplotTest, IsStoppedAtItsDeadline) {
  TempDir folder;
  EXPECT_EQ(RunGnuplot("while (1) { }\n", folder.path(), absl::Milliseconds(1)).code(),
            absl::StatusCode::kDeadlineExceeded);
}

TEST(BoardFigureTest, OnTheBoardRedMustBlockTheRightMostColumnAndHasNoWin) {
  const auto board = Board::FromMoves(kBoardMoves);
  ASSERT_TRUE(board.ok()) << board.status();
  EXPECT_EQ(board->ply() % 2, 0);  // Red, the first player, is to move
  EXPECT_EQ(board->ThreatenedColumns(), 1u << 6);
  EXPECT_EQ(board->WinningColumns(), 0u);
}

// A policy whose networks prefer a column by their last biases alone.
std::shared_ptr<const PolicyNetworks> Preferring(const std::vector<std::pair<std::string, int>>& networks) {
  PolicySnapshot snapshot;
  snapshot.version = 1;
  snapshot.spec = {.env = "connect4",
                   .algorithm = "dbr",
                   .observation_size = connect4::kObservationSize,
                   .actions = {ActionKind::kDiscrete, connect4::kColumns},
                   .hidden_sizes = {4}};
  const MlpShape shape(connect4::kObservationSize, {4}, connect4::kColumns);
  for (const auto& [name, column] : networks) {
    std::vector<float> parameters(static_cast<std::size_t>(shape.parameter_count()), 0.0f);
    parameters[parameters.size() - connect4::kColumns + column] = 2.0f;
    snapshot.networks.emplace_back(name, std::move(parameters));
  }
  return PolicyNetworks::Create(std::move(snapshot)).value();
}

TEST(BoardFigureTest, ShowsTheBehaviourPoliciesThatASnapshotHas) {
  const auto dbr = AskAboutBoard(*Preferring({{kPolicyNetwork, 6}, {kBetaPlus, 0}, {kBetaMinus, 6}}), "DBR");
  ASSERT_TRUE(dbr.ok()) << dbr.status();
  EXPECT_EQ(dbr->move, 6);
  ASSERT_THAT(dbr->distributions, SizeIs(3));
  EXPECT_EQ(dbr->distributions[1].label, "β+");
  EXPECT_GT(dbr->distributions[1].probabilities[0], dbr->distributions[1].probabilities[6]);

  const auto bear = AskAboutBoard(*Preferring({{kPolicyNetwork, 0}, {"behavior", 3}}), "BEAR");
  ASSERT_TRUE(bear.ok()) << bear.status();
  EXPECT_EQ(bear->move, 0);
  ASSERT_THAT(bear->distributions, SizeIs(2));
  EXPECT_EQ(bear->distributions[1].label, "behaviour policy");
  EXPECT_GT(bear->distributions[1].probabilities[3], bear->distributions[1].probabilities[0]);

  EXPECT_THAT(BoardFigure({*dbr, *bear}),
              AllOf(HasSubstr("DBR: plays column 7, which blocks"),
                    HasSubstr("BEAR: plays column 1, and loses"), HasSubstr("β−")));
}

TEST(SettingsTest, ListsWhatIsNotAtItsDefaultAndTellsConfigsApart) {
  Config config;
  config.set_seed(3);
  config.mutable_env()->set_name("hopper");
  config.mutable_algorithm()->set_discount(0.99);  // the default
  config.mutable_algorithm()->mutable_bear()->set_epsilon(0.1);
  config.mutable_network()->add_hidden_sizes(64);
  const Settings settings = SettingsOf(config);
  EXPECT_EQ(settings.differences,
            "env.name: \"hopper\"\nnetwork.hidden_sizes: [64]\nalgorithm.bear.epsilon: 0.1\n");
  Config other = config;
  other.set_seed(4);
  EXPECT_EQ(SettingsOf(other).digest, settings.digest);
  other.mutable_algorithm()->mutable_bear()->set_epsilon(0.2);
  EXPECT_NE(SettingsOf(other).digest, settings.digest);
}

TEST(SettingsTest, WhereTheOfflineDataLiesChangesNothing) {
  Config config;
  config.mutable_replay()->mutable_seed_buffer()->set_path("/here/hopper-medium.hdf5");
  const Settings here = SettingsOf(config);
  EXPECT_EQ(here.differences, "algorithm.dbr {}\nreplay.seed_buffer.path: \"hopper-medium.hdf5\"\n");
  config.mutable_replay()->mutable_seed_buffer()->set_path("hopper-medium.hdf5");
  EXPECT_EQ(SettingsOf(config).digest, here.digest);
}

TEST(SettingsTest, WhatCannotChangeTheResultsIsNotListed) {
  Config config;
  config.mutable_algorithm()->mutable_sac()->set_target_entropy(-2);
  const Settings plain = SettingsOf(config);
  EXPECT_EQ(plain.differences, "algorithm.sac.target_entropy: -2\n");
  config.mutable_algorithm()->set_threads(1);
  config.mutable_replay()->set_address("unix:/elsewhere/replay.sock");
  config.mutable_learner()->set_checkpoint_every_s(1);
  EXPECT_EQ(SettingsOf(config).differences, plain.differences);
  EXPECT_EQ(SettingsOf(config).digest, plain.digest);
}

TEST(SettingsTest, NamesAnAlgorithmThatIsAllAtItsDefaults) {
  Config config;
  config.mutable_algorithm()->mutable_ddqn();
  EXPECT_EQ(SettingsOf(config).differences, "algorithm.ddqn {}\n");
}

TEST(DocumentTest, TextIsTextInBothForms) {
  Document document;
  document.title = "a|b";
  document.Add(Table{{"<x>"}, {{{"a|b*", true}}}, ""});
  EXPECT_THAT(Markdown(document),
              AllOf(HasSubstr("# a\\|b"), HasSubstr("| &lt;x> |"), HasSubstr("**a\\|b\\***")));
  EXPECT_THAT(Html(document, {}), AllOf(HasSubstr("<th>&lt;x&gt;</th>"), HasSubstr("<b>a|b*</b>")));
}

TEST(DocumentTest, NamesWithinPicturesAreTheirOwnOnAPage) {
  Document document;
  document.Add(Picture{"plots/a.svg", "A", "one"});
  document.Add(Picture{"plots/b.svg", "B", "two"});
  const std::string svg = "<?xml?><svg ><title>Gnuplot</title><g id='p'/><use href='#p'/></svg>";
  const std::string page = Html(document, {svg, svg});
  EXPECT_THAT(page, AllOf(HasSubstr("id='f1-p'"), HasSubstr("href='#f2-p'"), Not(HasSubstr("Gnuplot")),
                          Not(HasSubstr("<?xml"))));
}

}  // namespace
}  // namespace dbr::report
