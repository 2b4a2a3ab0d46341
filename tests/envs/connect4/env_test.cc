#include "envs/connect4/env.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <vector>

#include "core/rng.h"
#include "core/symmetry.h"
#include "envs/connect4/board.h"
#include "envs/env.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr::connect4 {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

// An environment with memory for its outputs.
struct World {
  explicit World(std::vector<std::string> opponents, double random_start_share = 0)
      : env(Connect4Env::Make(opponents, random_start_share).value()) {}

  void Reset(std::uint64_t seed) { env->Reset(seed, absl::MakeSpan(observation), absl::MakeSpan(mask)); }
  StepResult Step(int column) {
    const float action = static_cast<float>(column);
    return env->Step(absl::MakeConstSpan(&action, 1), absl::MakeSpan(observation), absl::MakeSpan(mask));
  }
  int FirstLegal() const {
    return static_cast<int>(std::find(mask.begin(), mask.end(), 1.0f) - mask.begin());
  }

  // Returns the stones of a plane: 0 for the agent's, 1 for the opponent's.
  Cells Stones(int plane) const {
    Cells stones = 0;
    for (int row = 0; row < kRows; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        if (observation[kCells * plane + kColumns * row + column] == 1.0f) stones |= Cell(column, row);
      }
    }
    return stones;
  }

  std::unique_ptr<Env> env;
  std::array<float, kObservationSize> observation = {};
  std::array<float, kColumns> mask = {};
};

TEST(Connect4Env, TheAgentStartsWithAnEvenSeedAndTheOpponentWithAnOddOne) {
  World world({});
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    world.Reset(seed);
    EXPECT_EQ(world.Stones(0), 0u);
    EXPECT_EQ(std::popcount(world.Stones(1)), seed % 2 == 1 ? 1 : 0) << seed;
    EXPECT_THAT(world.mask, Each(1.0f));
  }
}

TEST(Connect4Env, RandomStartsAreAtAllStagesOfAGameThatHasNotEnded) {
  World world({}, /*random_start_share=*/1);
  std::array<int, kCells> at_ply = {};
  int wins = 0, threats = 0;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    world.Reset(seed);
    const Cells own = world.Stones(0), other = world.Stones(1);
    const int lead = std::popcount(other) - std::popcount(own);
    ASSERT_TRUE(lead == 0 || lead == 1) << seed;  // the agent is to move
    ASSERT_FALSE(HasFour(own) || HasFour(other)) << seed;
    const Cells landing = LandingCells(own | other);
    ASSERT_NE(landing, 0u) << seed;
    bool wins_here = false, threatened = false;
    for (int column = 0; column < kColumns; ++column) {
      const Cells cell = landing & (Cells{0x3f} << (kColumnStride * column));
      EXPECT_EQ(world.mask[column] == 1.0f, cell != 0) << seed;
      wins_here |= HasFour(own | cell);
      threatened |= HasFour(other | cell);
    }
    wins += wins_here;
    threats += threatened && !wins_here;
    ++at_ply[std::popcount(own | other)];
  }
  // A game of random moves has about 21, so each of the first plies is met once in about 20 games.
  EXPECT_GT(at_ply[0], 100);
  EXPECT_GT(at_ply[1], 100);
  EXPECT_GT(std::accumulate(at_ply.begin() + 18, at_ply.end(), 0), 500);
  EXPECT_GT(std::accumulate(at_ply.begin() + 30, at_ply.end(), 0), 40);
  EXPECT_GT(wins, 200);
  EXPECT_GT(threats, 200);
}

TEST(Connect4Env, TheShareOfRandomStartsIsAsStated) {
  World world({}, /*random_start_share=*/0.25);
  int later = 0;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    world.Reset(seed);
    later += std::popcount(world.Stones(0) | world.Stones(1)) > 1;
  }
  EXPECT_NEAR(later / 4000.0, 0.25 * 0.9, 0.03);  // one random start in ten is at the first two plies
}

TEST(Connect4Env, AGameFromARandomStartIsPlayedToItsEnd) {
  World world({"one_ply"}, /*random_start_share=*/1);
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    world.Reset(seed);
    int steps = 0;
    while (!world.Step(world.FirstLegal()).done()) ASSERT_LT(++steps, kCells / 2) << seed;
  }
}

TEST(Connect4Env, AStepHoldsTheAgentsMoveAndTheReply) {
  World world({});
  world.Reset(0);
  const StepResult result = world.Step(2);
  EXPECT_FALSE(result.done());
  EXPECT_EQ(result.reward, 0);
  EXPECT_EQ(world.Stones(0), Cell(2, 0));
  EXPECT_EQ(std::popcount(world.Stones(1)), 1);
}

TEST(Connect4Env, TheLastStepShowsTheFinalPositionAndItsOutcome) {
  World world({"random", "one_ply", "mcts:10"});
  std::array<int, 3> outcomes = {};  // lost, drawn, won
  Rng rng(51);
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    world.Reset(seed);
    StepResult result;
    while (!result.done()) {
      int column = static_cast<int>(rng.Below(kColumns));
      while (world.mask[column] == 0) column = (column + 1) % kColumns;
      result = world.Step(column);
    }
    const bool won = HasFour(world.Stones(0));
    const bool lost = HasFour(world.Stones(1));
    ASSERT_FALSE(won && lost);
    ASSERT_EQ(result.reward, won ? 1 : lost ? -1 : 0);
    ASSERT_EQ(result.score, won ? 1 : lost ? 0 : 0.5f);
    ASSERT_TRUE(result.terminated && !result.truncated);
    ASSERT_TRUE(won || lost || (world.Stones(0) | world.Stones(1)) == kAllCells);
    ASSERT_THAT(world.mask, Each(0.0f));
    ++outcomes[static_cast<int>(result.reward) + 1];
  }
  EXPECT_THAT(outcomes, Each(testing::Gt(0)));
}

// Follows an episode of the environment on a second board, on which all columns are mirrored.
class MirroredGame {
 public:
  explicit MirroredGame(const World& world) : world_(world) {}

  // Plays the stones that the world shows and the boards lack. The agent's come first.
  void Follow() {
    for (const int plane : {0, 1}) {
      const Cells fresh = world_.Stones(plane) & ~board_.occupied();
      if (fresh == 0) continue;
      ASSERT_EQ(std::popcount(fresh), 1);
      const int column = std::countr_zero(fresh) / kColumnStride;
      board_.Play(column);
      mirrored_.Play(kColumns - 1 - column);
      agent_moved_last_ = plane == 0;
    }
  }

  // What the environment would write for the mirrored board.
  void Write(absl::Span<float> observation, absl::Span<float> mask) const {
    const Cells agent = agent_moved_last_ ? mirrored_.other() : mirrored_.mover();
    WriteObservation(mirrored_, observation, mask);
    WritePlanes(agent, agent ^ mirrored_.occupied(), observation);
  }
  int reward() const { return !mirrored_.LastMoveWon() ? 0 : agent_moved_last_ ? 1 : -1; }
  bool done() const { return mirrored_.IsOver(); }

 private:
  const World& world_;
  Board board_, mirrored_;
  bool agent_moved_last_ = false;
};

// The image of floats under a permutation.
template <std::size_t n>
std::array<float, n> Image(const std::vector<int>& places, const std::array<float, n>& floats) {
  std::array<float, n> image;
  for (std::size_t i = 0; i < n; ++i) image[static_cast<std::size_t>(places[i])] = floats[i];
  return image;
}

TEST(Connect4Env, ItsSymmetryMapsEveryGameToTheMirroredGame) {
  World world({"random", "one_ply"});
  const Symmetry symmetry = world.env->spec().symmetry;
  ASSERT_TRUE(CheckSymmetry(symmetry, kObservationSize, kColumns).ok());
  Rng rng(8);
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    MirroredGame game(world);
    world.Reset(seed);
    StepResult result;
    while (true) {
      game.Follow();
      std::array<float, kObservationSize> observation;
      std::array<float, kColumns> mask;
      game.Write(absl::MakeSpan(observation), absl::MakeSpan(mask));
      ASSERT_EQ(Image(symmetry.observation, world.observation), observation) << seed;
      ASSERT_EQ(Image(symmetry.action, world.mask), mask) << seed;
      ASSERT_EQ(result.reward, game.reward());
      ASSERT_EQ(result.done(), game.done());
      if (result.done()) break;
      int column = static_cast<int>(rng.Below(kColumns));
      while (world.mask[column] == 0) column = (column + 1) % kColumns;
      ASSERT_EQ(symmetry.action[column], kColumns - 1 - column);
      result = world.Step(column);
    }
  }
}

TEST(Connect4Env, DrawsAnOpponentForEachEpisode) {
  World world({"random", "one_ply"});
  std::array<int, 2> blocked = {};  // threats that the opponent blocked, by starting side
  std::array<int, 2> threats = {};
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    world.Reset(seed);
    bool undisturbed = true;  // the column has only the agent's stones and the game continues
    for (int stone = 0; stone < 3 && undisturbed; ++stone) {
      undisturbed = !world.Step(3).done();
      if (stone < 2)
        undisturbed = undisturbed && (world.Stones(1) & (Cells{0x3f} << (3 * kColumnStride))) == 0;
    }
    const bool three =
        (world.Stones(0) & (Cell(3, 0) | Cell(3, 1) | Cell(3, 2))) == (Cell(3, 0) | Cell(3, 1) | Cell(3, 2));
    if (!undisturbed || !three) continue;
    ++threats[seed % 2];
    blocked[seed % 2] += (world.Stones(1) & Cell(3, 3)) != 0;
  }
  for (const int side : {0, 1}) {  // one_ply always blocks, random with probability 1/7
    EXPECT_GT(threats[side], 500);
    EXPECT_NEAR(static_cast<double>(blocked[side]) / threats[side], 0.5 + 0.5 / 7, 0.08);
  }
}

TEST(Connect4Env, UnknownOpponentsAreRefusedByName) {
  const absl::Status status = Connect4Env::Make({"random", "grandmaster"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("grandmaster"));
}

}  // namespace
}  // namespace dbr::connect4
