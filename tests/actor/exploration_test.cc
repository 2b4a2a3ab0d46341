#include "actor/exploration.h"

#include <array>
#include <cmath>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;

constexpr ActionSpace kThree = {ActionKind::kDiscrete, 3};

TEST(ExplorationTest, LadderClimbsFromEpsilonToItsPower) {
  const Exploration exploration(kThree, 0.4, 7, 3);
  EXPECT_THAT(exploration.shares(),
              ElementsAre(DoubleEq(0.4), DoubleEq(std::pow(0.4, 4.5)), DoubleEq(std::pow(0.4, 8))));
}

TEST(ExplorationTest, WithoutALadderAllEnvironmentsHaveEpsilon) {
  EXPECT_THAT(Exploration(kThree, 0.1, 0, 3).shares(), ElementsAre(0.1, 0.1, 0.1));
}

TEST(ExplorationTest, ASingleEnvironmentStandsOnTheFirstRung) {
  EXPECT_THAT(Exploration(kThree, 0.4, 7, 1).shares(), ElementsAre(DoubleEq(0.4)));
}

TEST(ExplorationTest, ReplacesItsShareByUniformlyDrawnLegalActions) {
  constexpr int kRounds = 20000;
  const Exploration exploration(kThree, 0.5, 0, 1);
  MatrixX<float> masks(3, 1);
  masks << 1, 0, 1;
  Rng rng(3);
  int replaced = 0;
  std::array<int, 3> drawn = {};
  for (int round = 0; round < kRounds; ++round) {
    MatrixX<float> actions = MatrixX<float>::Constant(1, 1, -1);
    const int count = exploration.Apply(masks, rng, &actions);
    replaced += count;
    if (count > 0) ++drawn[static_cast<int>(actions(0, 0))];
    EXPECT_EQ(count > 0, actions(0, 0) >= 0);
  }
  // Four standard deviations: sqrt(20000 / 4) = 71 and sqrt(10000 / 4) = 50.
  EXPECT_NEAR(replaced, kRounds / 2, 284);
  EXPECT_EQ(drawn[1], 0);
  EXPECT_NEAR(drawn[0], replaced / 2, 200);
}

TEST(ExplorationTest, WithoutEpsilonNothingIsReplacedOrDrawn) {
  const Exploration exploration(kThree, 0, 3, 4);
  MatrixX<float> actions = MatrixX<float>::Constant(1, 4, 2);
  Rng rng(3);
  EXPECT_EQ(exploration.Apply(MatrixX<float>::Ones(3, 4), rng, &actions), 0);
  EXPECT_EQ(actions, (MatrixX<float>::Constant(1, 4, 2)));
  EXPECT_EQ(rng.state(), Rng(3).state());
}

TEST(ExplorationTest, DrawsContinuousActionsFromTheWholeBox) {
  constexpr int kCount = 4000;
  const Exploration exploration({ActionKind::kContinuous, 2}, 1, 0, kCount);
  MatrixX<float> actions = MatrixX<float>::Constant(2, kCount, 9);
  Rng rng(3);
  EXPECT_EQ(exploration.Apply(MatrixX<float>(0, kCount), rng, &actions), kCount);
  EXPECT_LE(actions.maxCoeff(), 1);
  EXPECT_GE(actions.minCoeff(), -1);
  EXPECT_GT(actions.maxCoeff(), 0.99);
  EXPECT_LT(actions.minCoeff(), -0.99);
  EXPECT_NEAR(actions.mean(), 0, 4 * std::sqrt(1.0 / 3 / (2 * kCount)));
}

}  // namespace
}  // namespace dbr
