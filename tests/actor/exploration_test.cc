#include "actor/exploration.h"

#include <array>
#include <cmath>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr {
namespace {

using ::testing::DoubleEq;
using ::testing::Each;
using ::testing::ElementsAre;

constexpr ActionSpace kThree = {ActionKind::kDiscrete, 3};
constexpr ActionSpace kPlane = {ActionKind::kContinuous, 2};

TEST(ExplorationTest, LadderClimbsFromEpsilonToItsPower) {
  const Exploration exploration(kThree, {.epsilon = 0.4, .epsilon_ladder = 7}, 3);
  EXPECT_THAT(exploration.shares(),
              ElementsAre(DoubleEq(0.4), DoubleEq(std::pow(0.4, 4.5)), DoubleEq(std::pow(0.4, 8))));
}

TEST(ExplorationTest, WithoutALadderAllEnvironmentsHaveEpsilon) {
  EXPECT_THAT(Exploration(kThree, {.epsilon = 0.1}, 3).shares(), ElementsAre(0.1, 0.1, 0.1));
}

TEST(ExplorationTest, ASingleEnvironmentStandsOnTheFirstRung) {
  EXPECT_THAT(Exploration(kThree, {.epsilon = 0.4, .epsilon_ladder = 7}, 1).shares(),
              ElementsAre(DoubleEq(0.4)));
}

TEST(ExplorationTest, ReplacesItsShareByUniformlyDrawnLegalActions) {
  constexpr int kRounds = 20000;
  Exploration exploration(kThree, {.epsilon = 0.5}, 1);
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
  Exploration exploration(kThree, {.epsilon_ladder = 3}, 4);
  MatrixX<float> actions = MatrixX<float>::Constant(1, 4, 2);
  Rng rng(3);
  EXPECT_EQ(exploration.Apply(MatrixX<float>::Ones(3, 4), rng, &actions), 0);
  EXPECT_EQ(actions, (MatrixX<float>::Constant(1, 4, 2)));
  EXPECT_EQ(rng.state(), Rng(3).state());
}

TEST(ExplorationTest, DrawsContinuousActionsFromTheWholeBox) {
  constexpr int kCount = 4000;
  Exploration exploration(kPlane, {.epsilon = 1}, kCount);
  MatrixX<float> actions = MatrixX<float>::Constant(2, kCount, 9);
  Rng rng(3);
  EXPECT_EQ(exploration.Apply(MatrixX<float>(0, kCount), rng, &actions), kCount);
  EXPECT_LE(actions.maxCoeff(), 1);
  EXPECT_GE(actions.minCoeff(), -1);
  EXPECT_GT(actions.maxCoeff(), 0.99);
  EXPECT_LT(actions.minCoeff(), -0.99);
  EXPECT_NEAR(actions.mean(), 0, 4 * std::sqrt(1.0 / 3 / (2 * kCount)));
}

// Makes `rounds` steps.
void Step(Exploration* exploration, int rounds) {
  const auto n = static_cast<Eigen::Index>(exploration->shares().size());
  MatrixX<float> actions = MatrixX<float>::Zero(1, n);
  Rng rng(3);
  for (int round = 0; round < rounds; ++round) exploration->Apply(MatrixX<float>::Ones(3, n), rng, &actions);
}

TEST(ExplorationTest, EpsilonFallsLinearlyOverTheStepsOfAllProcessesAndStays) {
  Exploration exploration(
      kThree, {.epsilon = 1, .epsilon_decay_steps = 100, .final_epsilon = 0.2, .processes = 5}, 2);
  EXPECT_THAT(exploration.shares(), Each(DoubleEq(1)));
  Step(&exploration, 1);  // two environments, five processes: ten steps
  EXPECT_THAT(exploration.shares(), Each(DoubleEq(0.92)));
  Step(&exploration, 4);
  EXPECT_THAT(exploration.shares(), Each(DoubleEq(0.6)));
  Step(&exploration, 5);
  EXPECT_THAT(exploration.shares(), Each(DoubleEq(0.2)));
  Step(&exploration, 50);
  EXPECT_THAT(exploration.shares(), Each(DoubleEq(0.2)));
}

TEST(ExplorationTest, EpsilonRisesWhereItsFinalValueIsTheGreater) {
  Exploration exploration(kThree, {.epsilon = 0, .epsilon_decay_steps = 10, .final_epsilon = 0.5}, 1);
  Step(&exploration, 5);
  EXPECT_THAT(exploration.shares(), ElementsAre(DoubleEq(0.25)));
}

TEST(ExplorationTest, GoesOnFromTheStepsThatWereDoneBefore) {
  const ExplorationOptions options = {
      .epsilon = 1, .epsilon_decay_steps = 100, .final_epsilon = 0, .first_step = 75};
  EXPECT_THAT(Exploration(kThree, options, 1).shares(), ElementsAre(DoubleEq(0.25)));
}

TEST(ExplorationTest, TheLadderStandsOnTheCurrentEpsilon) {
  Exploration exploration(
      kThree, {.epsilon = 1, .epsilon_ladder = 2, .epsilon_decay_steps = 10, .final_epsilon = 0}, 5);
  Step(&exploration, 1);
  EXPECT_THAT(exploration.shares(),
              ElementsAre(DoubleEq(0.5), DoubleEq(std::pow(0.5, 1.5)), DoubleEq(std::pow(0.5, 2)),
                          DoubleEq(std::pow(0.5, 2.5)), DoubleEq(std::pow(0.5, 3))));
}

TEST(ExplorationTest, NoiseIsNormalAroundTheChosenAction) {
  constexpr int kCount = 10000;
  Exploration exploration(kPlane, {.action_noise = 0.1}, kCount);
  MatrixX<float> actions = MatrixX<float>::Constant(2, kCount, 0.25f);
  Rng rng(3);
  EXPECT_EQ(exploration.Apply(MatrixX<float>(0, kCount), rng, &actions), 0);
  const Eigen::ArrayXXf noise = actions.array() - 0.25f;
  EXPECT_NEAR(noise.mean(), 0, 4 * 0.1 / std::sqrt(2.0 * kCount));
  EXPECT_NEAR(noise.square().mean(), 0.01, 4 * 0.01 * std::sqrt(2.0 / (2 * kCount)));
  EXPECT_NEAR((noise.row(0) * noise.row(1)).mean(), 0, 4 * 0.01 / std::sqrt(1.0 * kCount));
}

TEST(ExplorationTest, NoisyActionsStayInTheBox) {
  constexpr int kCount = 200;
  Exploration exploration(kPlane, {.action_noise = 2}, kCount);
  MatrixX<float> actions = MatrixX<float>::Zero(2, kCount);
  Rng rng(3);
  exploration.Apply(MatrixX<float>(0, kCount), rng, &actions);
  EXPECT_EQ(actions.maxCoeff(), 1);
  EXPECT_EQ(actions.minCoeff(), -1);
}

TEST(ExplorationTest, ReplacedActionsGetNoNoise) {
  constexpr int kCount = 100;
  Exploration plain(kPlane, {.epsilon = 1}, kCount), noisy(kPlane, {.epsilon = 1, .action_noise = 5}, kCount);
  MatrixX<float> actions = MatrixX<float>::Zero(2, kCount), others = actions;
  Rng rng(3), same(3);
  plain.Apply(MatrixX<float>(0, kCount), rng, &actions);
  noisy.Apply(MatrixX<float>(0, kCount), same, &others);
  EXPECT_EQ(actions, others);
}

TEST(CheckExplorationTest, RefusesNoiseOnDiscreteActionsAlone) {
  ActorConfig config;
  config.set_action_noise(0.1);
  const EnvSpec discrete = {.name = "line", .actions = kThree},
                continuous = {.name = "hopper", .actions = kPlane};
  EXPECT_TRUE(CheckExploration(continuous, config).ok());
  const absl::Status status = CheckExploration(discrete, config);
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_EQ(status.message(),
            "actor.action_noise: expected 0 for the discrete actions of environment 'line', found 0.1. Use "
            "actor.epsilon there.");
  config.set_action_noise(0);
  EXPECT_TRUE(CheckExploration(discrete, config).ok());
}

}  // namespace
}  // namespace dbr
