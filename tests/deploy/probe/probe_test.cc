// What `dbr probe` reads, asks and counts.
#include "deploy/probe/probe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "deploy/probe/positions_file.h"
#include "deploy/probe/probe_report.h"
#include "deploy/terminal/terminal.h"
#include "nn/mlp.h"
#include "tests/support/reference_dir.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using connect4::Board;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using Json = nlohmann::ordered_json;

// A policy whose every network says 0 but for its last biases: the further right a column, the likelier.
std::shared_ptr<const PolicyNetworks> RightmostPolicy(const std::vector<std::string>& networks) {
  PolicySnapshot snapshot;
  snapshot.version = 1;
  snapshot.spec = {.env = "connect4",
                   .algorithm = "dbr",
                   .observation_size = connect4::kObservationSize,
                   .actions = {ActionKind::kDiscrete, connect4::kColumns},
                   .hidden_sizes = {4}};
  const MlpShape shape(connect4::kObservationSize, {4}, connect4::kColumns);
  std::vector<float> parameters(static_cast<std::size_t>(shape.parameter_count()), 0.0f);
  for (int c = 0; c < connect4::kColumns; ++c)
    parameters[parameters.size() - connect4::kColumns + c] = 0.1f * c;
  for (const std::string& name : networks) snapshot.networks.emplace_back(name, parameters);
  return PolicyNetworks::Create(std::move(snapshot)).value();
}

std::shared_ptr<const PolicyNetworks> FullPolicy() {
  return RightmostPolicy({kPolicyNetwork, kCritic1, kCritic2, kBetaPlus, kBetaMinus});
}

TEST(ProbeTest, AsksEveryNetworkAndPlaysALegalMove) {
  const auto policy = FullPolicy();
  // Column 7 is full in the second position.
  const std::vector<Board> boards = {Board(), *Board::FromMoves("777777")};
  const auto probed = Probe(*policy, boards, MODE, 1);
  ASSERT_TRUE(probed.ok()) << probed.status();
  EXPECT_EQ((*probed)[0].move, 6);
  EXPECT_EQ((*probed)[1].move, 5);
  EXPECT_EQ((*probed)[1].pi[6], 0);
  EXPECT_GT((*probed)[0].pi[6], (*probed)[0].pi[0]);
  EXPECT_THAT((*probed)[0].beta_minus, SizeIs(7));
  EXPECT_FLOAT_EQ((*probed)[0].q[3], 0.3f);
}

TEST(ProbeTest, LeavesOutWhatThePolicyLacks) {
  const auto policy = RightmostPolicy({kPolicyNetwork});
  const auto probed = Probe(*policy, {Board()}, MODE, 1);
  ASSERT_TRUE(probed.ok()) << probed.status();
  EXPECT_THAT((*probed)[0].pi, SizeIs(7));
  EXPECT_THAT((*probed)[0].beta_plus, IsEmpty());
  EXPECT_THAT((*probed)[0].q, IsEmpty());
  EXPECT_EQ(Probe(*policy, {Board()}, GREEDY_Q, 1).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ProbeTest, RefusesAFinishedGame) {
  const auto probed = Probe(*FullPolicy(), {*Board::FromMoves("1212121")}, MODE, 1);
  EXPECT_EQ(probed.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(probed.status().message()), HasSubstr("ended with move 7"));
}

TEST(ProbeTest, RefusesAPolicyOfAnotherEnvironment) {
  PolicySnapshot snapshot = FullPolicy()->snapshot();
  snapshot.spec.actions.size = 6;
  snapshot.spec.env = "line";
  const MlpShape shape(connect4::kObservationSize, {4}, 6);
  for (auto& [name, parameters] : snapshot.networks)
    parameters.resize(static_cast<std::size_t>(shape.parameter_count()));
  const auto policy = PolicyNetworks::Create(snapshot);
  ASSERT_TRUE(policy.ok()) << policy.status();
  EXPECT_THAT(std::string(Probe(**policy, {Board()}, MODE, 1).status().message()),
              HasSubstr("the policy is for 'line'"));
}

ReferencePosition Position(const std::string& kind, int answer, std::vector<int> keeps,
                           std::vector<int> best) {
  return {.id = "p",
          .moves = "",
          .legal = {1, 2, 3, 4, 5, 6, 7},
          .keeps_value = std::move(keeps),
          .best = std::move(best),
          .kind = kind,
          .answer = answer};
}

TEST(ScoreMovesTest, CountsEachShareOverItsOwnPositions) {
  ProbedPosition plays_seven;
  plays_seven.move = 6;
  const std::vector<ReferencePosition> positions = {
      Position("must_block", 7, {7}, {7}), Position("must_block", 1, {1}, {1}),
      Position("must_win", 2, {2}, {2}), Position("", 0, {1, 2, 3, 4, 5, 6, 7}, {7}),
      Position("", 0, {6, 7}, {6})};
  const ProbeShares shares =
      ScoreMoves(positions, std::vector<ProbedPosition>(positions.size(), plays_seven));
  EXPECT_EQ(shares.positions, 5);
  EXPECT_EQ(shares.must_block, 0.5);
  EXPECT_EQ(shares.must_win, 0.0);
  EXPECT_EQ(shares.keeps_value_decisive, 0.5);  // of four; the fourth position has no wrong move
  EXPECT_EQ(shares.best, 0.4);
}

TEST(ScoreMovesTest, AKindThatTheFileLacksIsNull) {
  const ProbeShares shares = ScoreMoves({Position("", 0, {1, 2, 3, 4, 5, 6, 7}, {7})}, {ProbedPosition{}});
  EXPECT_EQ(ToJson(shares).dump(),
            R"({"positions":1,"must_block":null,"must_win":null,"keeps_value_decisive":null,"best":0.0})");
}

TEST(PositionsFileTest, ReadsEveryReferenceFile) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(ReferenceDir() / "connect4")) {
    const std::string name = entry.path().filename().string();
    const bool tactics = absl::StartsWith(name, "tactics");
    if ((!tactics && !absl::StartsWith(name, "positions")) || entry.path().extension() != ".json") continue;
    ++files;
    const auto positions = LoadPositions(entry.path().string());
    ASSERT_TRUE(positions.ok()) << positions.status();
    std::vector<Board> boards;
    for (const ReferencePosition& position : *positions) {
      boards.push_back(*Board::FromMoves(position.moves));
      EXPECT_EQ(position.kind.empty(), !tactics);
      for (const int column : position.legal) EXPECT_TRUE(boards.back().IsLegal(column - 1));
    }
    const auto probed = Probe(*FullPolicy(), boards, MODE, 1);
    ASSERT_TRUE(probed.ok()) << probed.status();
    const ProbeShares shares = ScoreMoves(*positions, *probed);
    EXPECT_EQ(shares.positions, positions->size());
    EXPECT_EQ(shares.must_block.has_value(), tactics);
    ASSERT_TRUE(shares.keeps_value_decisive.has_value());
    // Always the rightmost column: no better than chance on positions with a wrong move.
    EXPECT_LT(*shares.keeps_value_decisive, 0.6);
  }
  EXPECT_GE(files, 2);
}

TEST(PositionsFileTest, NamesWhatIsWrong) {
  TempDir folder;
  const std::string path = folder / "positions.json";
  const auto error = [&](const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(path, text).ok());
    const absl::Status status = LoadPositions(path).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << text;
    return std::string(status.message());
  };
  EXPECT_THAT(error("{\"positions\": [{\"moves\""), HasSubstr("expected JSON"));
  EXPECT_THAT(error(std::string(100000, '[')), HasSubstr("expected JSON, found lists and objects more than"));
  EXPECT_THAT(error("[]"), HasSubstr("'positions'"));
  EXPECT_THAT(error("{\"positions\": []}"), HasSubstr("found none"));
  EXPECT_THAT(error("{\"positions\": [7]}"), HasSubstr("positions[0]: expected an object"));
  EXPECT_THAT(error("{\"positions\": [{\"moves\": 44}]}"), HasSubstr("positions[0].moves"));
  EXPECT_THAT(error("{\"positions\": [{\"moves\": \"4\", \"legal\": [1, 8]}]}"),
              HasSubstr("positions[0].legal"));
  const std::string good = "\"moves\": \"4\", \"legal\": [1], \"keeps_value\": [1], \"best\": [1]";
  EXPECT_THAT(error("{\"positions\": [{" + good + "}, {" + good + ", \"kind\": \"must_win\"}]}"),
              HasSubstr("positions[1].answer"));
  EXPECT_EQ(LoadPositions(folder / "none.json").status().code(), absl::StatusCode::kNotFound);
}

TEST(FigureTest, DrawsTheBoardAndTheBars) {
  const auto probed = Probe(*FullPolicy(), {*Board::FromMoves("4777777")}, MODE, 1);
  const std::string figure = PositionText("4777777", (*probed)[0]);
  EXPECT_THAT(figure, AllOf(HasSubstr("player 2 (○) to move"), HasSubstr("plays column 6"),
                            HasSubstr("· · · ● · · ○"), HasSubstr("6 ◀"), HasSubstr("full"),
                            HasSubstr("beta-"), HasSubstr("0.50")));
}

TEST(FigureTest, ShowsOneBehaviourInPlaceOfTwo) {
  const auto policy = RightmostPolicy({kPolicyNetwork, kCritic1, kCritic2, kBehavior});
  const auto probed = Probe(*policy, {Board()}, MODE, 1);
  ASSERT_TRUE(probed.ok()) << probed.status();
  EXPECT_THAT((*probed)[0].beta, SizeIs(7));
  EXPECT_THAT(PositionText("", (*probed)[0]), AllOf(HasSubstr("beta "), Not(HasSubstr("beta+"))));
  EXPECT_THAT(PositionLine(Position("", 0, {7}, {7}), (*probed)[0]),
              AllOf(HasSubstr("│  beta │"), Not(HasSubstr("beta-"))));
  const Json json = ToJson("", (*probed)[0]);
  EXPECT_GT(json["beta"][6].get<double>(), json["beta"][0].get<double>());
  EXPECT_TRUE(json["beta_plus"].is_null());
}

TEST(FigureTest, OneLineHasTheVerdict) {
  const auto probed = Probe(*FullPolicy(), {Board()}, MODE, 1);
  EXPECT_THAT(PositionLine(Position("", 0, {7}, {7}), (*probed)[0]), HasSubstr("plays 7 ✓"));
  EXPECT_THAT(PositionLine(Position("", 0, {6, 7}, {6}), (*probed)[0]), HasSubstr("plays 7 ~"));
  EXPECT_THAT(PositionLine(Position("must_win", 1, {1}, {1}), (*probed)[0]),
              AllOf(HasSubstr("plays 7 ✗"), HasSubstr("must_win")));
}

TEST(FigureTest, JsonHasNullForAFullColumn) {
  const auto probed =
      Probe(*RightmostPolicy({kPolicyNetwork, kCritic1, kCritic2}), {*Board::FromMoves("777777")}, MODE, 1);
  const Json json = ToJson("777777", (*probed)[0]);
  EXPECT_EQ(json["moves"], "777777");
  EXPECT_EQ(json["to_move"], 1);
  EXPECT_EQ(json["move"], 6);
  ASSERT_EQ(json["pi"].size(), 7);
  EXPECT_TRUE(json["pi"][6].is_null());
  EXPECT_TRUE(json["q"][6].is_null());
  EXPECT_TRUE(json["beta_plus"].is_null());
  EXPECT_TRUE(json["beta"].is_null());
  EXPECT_NEAR(json["q"][5].get<double>(), 0.5, 1e-6);
}

}  // namespace
}  // namespace dbr
