// Tests DBR over discrete actions: what its settings mean, and small problems with known answers.
#include "learner/algorithms/discrete_dbr.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "core/rng.h"
#include "learner/algorithms/registry.h"
#include "tests/learner/algorithms/batches.h"
#include "tests/learner/algorithms/tiny_problem.h"

namespace dbr {
namespace {

TEST(DiscreteDbr, TheThreeMmdsAreOne) {
  TensorFile states[3];
  for (int i = 0; i < 3; ++i) {
    AlgorithmSpec spec = SmallSpec();
    spec.config.mutable_dbr()->set_divergence(
        std::array{DbrConfig::MMD_EXACT, DbrConfig::MMD_LAPLACIAN, DbrConfig::MMD_GAUSSIAN}[i]);
    const auto algorithm = MakeAlgorithm(spec);
    ASSERT_TRUE(algorithm.ok()) << algorithm.status();
    Rng rng(4);
    const Batch uniform = RandomBatch<float>(spec, 16, rng), plus = RandomBatch<float>(spec, 16, rng);
    ASSERT_TRUE((*algorithm)->Update({uniform, plus, plus}).ok());
    (*algorithm)->Save(&states[i]);
  }
  EXPECT_EQ(states[0].tensors, states[1].tensors);
  EXPECT_EQ(states[0].tensors, states[2].tensors);
}

TEST(DiscreteDbr, WarmStartLeavesQOut) {
  // Policies whose critics see different data stay equal while Q is left out.
  std::vector<float> policies[2];
  for (const int variant : {0, 1}) {
    AlgorithmSpec spec = SmallSpec();
    spec.config.mutable_dbr()->set_warm_start_updates(3);
    DiscreteDbr<float> dbr(spec);
    Rng rng(3);
    for (int i = 0; i < 3; ++i) {
      Batch batch = RandomBatch<float>(spec, 16, rng);
      const Batch behavior = batch;
      batch.rewards *= static_cast<float>(1 + 10 * variant);
      ASSERT_TRUE(dbr.Update(batch, behavior, behavior).ok());
    }
    PolicySnapshot snapshot;
    dbr.ExportPolicy(&snapshot);
    policies[variant] = *snapshot.Find(kPolicyNetwork);
  }
  EXPECT_EQ(policies[0], policies[1]);
}

using DiscreteDbrTinyProblem = TinyProblem;

TEST_F(DiscreteDbrTinyProblem, TheTwoBehavioursOfABanditSeparate) {
  Train(Bandit(), 1, 3, 600);
  EXPECT_GT(view_.policy(1, 0), 0.9f);
  EXPECT_GT(view_.beta_plus(1, 0), 0.9f);
  EXPECT_LT(view_.beta_minus(1, 0), 0.2f);
  EXPECT_NEAR(view_.q(1, 0), 1, 0.05);
  EXPECT_NEAR(view_.q(0, 0), 0, 0.05);
}

TEST_F(DiscreteDbrTinyProblem, ATwoStateChainHasItsClosedFormValues) {
  Train(Chain(), 2, 2, 1500);
  EXPECT_NEAR(view_.q(0, 1), 1, 0.05);
  EXPECT_NEAR(view_.q(1, 1), -1, 0.05);
  EXPECT_NEAR(view_.q(0, 0), 0.9, 0.05);
  EXPECT_NEAR(view_.q(1, 0), 0.3, 0.05);
  EXPECT_GT(view_.policy(0, 0), 0.9f);
  EXPECT_GT(view_.policy(0, 1), 0.9f);
}

}  // namespace
}  // namespace dbr
