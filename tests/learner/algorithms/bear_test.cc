// Tests that BEAR stays near its data although Q points away from it, what it refuses, and what its settings
// do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "learner/algorithms/continuous_bear.h"
#include "learner/algorithms/discrete_bear.h"
#include "learner/algorithms/registry.h"
#include "nn/policy.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

AlgorithmSpec OneState(const ActionSpace& actions) {
  AlgorithmSpec spec = SmallSpec(1, actions.kind);
  spec.observation_size = 1;
  spec.actions = actions;
  spec.hidden_sizes = {32, 32};
  spec.config.set_batch_size(64);
  spec.config.set_learning_rate(3e-3);
  BearConfig* bear = spec.config.mutable_bear();
  bear->set_warm_start_updates(100);
  bear->set_multiplier_learning_rate(0.03);
  bear->add_vae_hidden_sizes(32);
  return spec;
}

// Gives BEAR a multiplier that stays near 0.
AlgorithmSpec Unconstrained(AlgorithmSpec spec) {
  spec.config.mutable_bear()->set_first_multiplier(0.007);
  spec.config.mutable_bear()->set_multiplier_learning_rate(0);
  return spec;
}

// 64 steps from one state that each end their episode. The caller fills in actions and rewards.
Batch EndingSteps(const AlgorithmSpec& spec) {
  Batch batch;
  batch.Resize({1, spec.actions.width(), spec.actions.mask_width()}, 64, /*with_keys=*/false);
  batch.observations.setOnes();
  batch.next_observations.setOnes();
  batch.masks.setOnes();
  batch.next_masks.setOnes();
  batch.discounts.setZero();
  return batch;
}

std::shared_ptr<const PolicyNetworks> PolicyOf(const Algorithm& algorithm) {
  PolicySnapshot snapshot;
  algorithm.ExportPolicy(&snapshot);
  return PolicyNetworks::Create(std::move(snapshot)).value();
}

// Returns the mean action learned from actions around 0.5. The reward is the action itself, so Q is greatest
// at 1.
float ContinuousAction(const AlgorithmSpec& spec) {
  const auto algorithm = MakeAlgorithm(spec).value();
  Rng rng(4);
  const Batch empty;
  for (int i = 0; i < 500; ++i) {
    Batch batch = EndingSteps(spec);
    for (float& action : batch.actions.reshaped()) action = 0.5f + 0.03f * static_cast<float>(rng.Normal());
    batch.rewards = 10 * batch.actions.row(0).transpose();
    EXPECT_TRUE(algorithm->Update({batch, empty, empty}).ok());
  }
  PolicyRunner runner;
  MatrixX<float> action(1, 1);
  EXPECT_TRUE(
      runner.Act(*PolicyOf(*algorithm), MODE, MatrixX<float>::Ones(1, 1), MatrixX<float>(0, 1), rng, action)
          .ok());
  return action(0, 0);
}

TEST(ContinuousBearTest, StaysOnTheDataWhereQPointsAway) {
  const AlgorithmSpec spec = OneState({ActionKind::kContinuous, 1});
  EXPECT_NEAR(ContinuousAction(spec), 0.5f, 0.1f);
  EXPECT_GT(ContinuousAction(Unconstrained(spec)), 0.9f);
}

// Returns the policy learned from actions 0 and 1, which cost 1. Action 2 is never seen, and its Q stays near
// 0.
VectorX<float> DiscreteProbabilities(const AlgorithmSpec& spec) {
  const auto algorithm = MakeAlgorithm(spec).value();
  Batch batch = EndingSteps(spec);
  const Batch empty;
  for (int j = 0; j < 64; ++j) batch.actions(0, j) = static_cast<float>(j % 2);
  batch.rewards.setConstant(-1);
  for (int i = 0; i < 500; ++i) EXPECT_TRUE(algorithm->Update({batch, empty, empty}).ok());
  PolicyRunner runner;
  const PolicyView& view =
      runner.View(*PolicyOf(*algorithm), MatrixX<float>::Ones(1, 1), MatrixX<float>::Ones(3, 1));
  EXPECT_NEAR(view.beta(0, 0), 0.5f, 0.05f);
  EXPECT_LT(view.beta(2, 0), 0.02f);
  EXPECT_GT(view.q(2, 0), view.q(0, 0));
  EXPECT_EQ(view.beta_plus.size(), 0);
  return view.policy.col(0);
}

TEST(DiscreteBearTest, StaysOnTheDataWhereQPointsAway) {
  AlgorithmSpec spec = OneState({ActionKind::kDiscrete, 3});
  spec.config.mutable_bear()->set_divergence(DbrConfig::KL);
  EXPECT_LT(DiscreteProbabilities(spec)[2], 0.1f);
  EXPECT_GT(DiscreteProbabilities(Unconstrained(spec))[2], 0.9f);
}

TEST(BearTest, WarmStartLeavesQOut) {
  for (const ActionKind kind : {ActionKind::kDiscrete, ActionKind::kContinuous}) {
    std::vector<float> policies[2];
    for (const bool warm : {true, false}) {
      // Two runs differ only in their rewards. The policies stay equal while Q is left out.
      for (const int variant : {0, 1}) {
        AlgorithmSpec spec = SmallSpec(1, kind);
        spec.config.mutable_bear()->set_warm_start_updates(warm ? 3 : 0);
        spec.config.mutable_bear()->add_vae_hidden_sizes(8);
        const auto algorithm = MakeAlgorithm(spec).value();
        Rng rng(3);
        const Batch empty;
        for (int i = 0; i < 3; ++i) {
          Batch batch = RandomBatch<float>(spec, 16, rng);
          batch.rewards *= static_cast<float>(1 + 10 * variant);
          ASSERT_TRUE(algorithm->Update({batch, empty, empty}).ok());
        }
        policies[variant] = *PolicyOf(*algorithm)->snapshot().Find(kPolicyNetwork);
      }
      EXPECT_EQ(policies[0] == policies[1], warm);
    }
  }
}

TEST(BearTest, ContinuousActionsNeedADivergenceFromSamples) {
  for (const auto& [divergence, serves] : {std::pair{DbrConfig::KL, false},
                                           {DbrConfig::MMD_EXACT, false},
                                           {DbrConfig::MMD_LAPLACIAN, true},
                                           {DbrConfig::MMD_GAUSSIAN, true}}) {
    AlgorithmSpec spec = SmallSpec(1, ActionKind::kContinuous);
    spec.config.mutable_bear()->set_divergence(divergence);
    const absl::Status status = MakeAlgorithm(spec).status();
    EXPECT_EQ(status.ok(), serves) << status;
    if (serves) continue;
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    EXPECT_THAT(std::string(status.message()),
                testing::AllOf(testing::HasSubstr("algorithm.bear.divergence: expected MMD_LAPLACIAN"),
                               testing::HasSubstr("found " + DbrConfig::Divergence_Name(divergence))));
    spec = SmallSpec(1, ActionKind::kDiscrete);
    spec.config.mutable_bear()->set_divergence(divergence);
    EXPECT_TRUE(MakeAlgorithm(spec).ok());
  }
}

TEST(ContinuousBearTest, ExportsNoBehaviourThatIsNotAPolicy) {
  AlgorithmSpec spec = SmallSpec(1, ActionKind::kContinuous);
  spec.config.mutable_bear();
  EXPECT_FALSE(PolicyOf(*MakeAlgorithm(spec).value())->has_behavior());
}

}  // namespace
}  // namespace dbr
