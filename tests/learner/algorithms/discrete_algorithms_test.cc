// Tests that Double DQN and discrete SAC solve small problems with known answers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "learner/algorithms/ddqn.h"
#include "tests/learner/algorithms/tiny_problem.h"

namespace dbr {
namespace {

using DdqnTinyProblem = TinyProblem;

TEST_F(DdqnTinyProblem, ATwoStateChainHasItsClosedFormValues) {
  config_.mutable_ddqn();
  Train(Chain(), 2, 2, 1500);
  EXPECT_NEAR(view_.q(0, 1), 1, 0.02);
  EXPECT_NEAR(view_.q(1, 1), -1, 0.02);
  EXPECT_NEAR(view_.q(0, 0), 0.9, 0.02);
  EXPECT_NEAR(view_.q(1, 0), 0.3, 0.02);
}

TEST_F(DdqnTinyProblem, AdvantagesAreMeasuredFromTheGreatestQ) {
  config_.mutable_ddqn();
  Train(Chain(), 2, 2, 1500);
  EXPECT_THAT(algorithm_->advantages(),
              testing::Pointwise(testing::FloatNear(0.03f), {0.0f, -0.6f, 0.0f, -2.0f}));
}

TEST_F(DdqnTinyProblem, TheFirstTargetIsTheTargetNetworksViewOfTheOnlineNetworksChoice) {
  AlgorithmSpec spec = SmallSpec();
  spec.config.mutable_ddqn();
  spec.config.set_learning_rate(0.05);
  Ddqn<double> ddqn(spec);
  Rng rng(5);
  const auto batch = RandomBatch<double>(spec, 16, rng);
  // Some steps come first, with a slow target, so that the two networks differ.
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(ddqn.Update(batch, batch, batch).ok());
  TensorFile file;
  ddqn.Save(&file);
  const MlpShape shape(spec.observation_size, spec.hidden_sizes, spec.actions.size);
  const auto q_of = [&](const char* name) {
    const std::vector<float>& parameters = file.tensors[name];
    MlpActivations<float> activations;
    return MatrixX<float>(
        MlpForward<float>(shape, parameters.data(), batch.next_observations.cast<float>(), &activations));
  };
  const MatrixX<float> online = q_of("policy"), target = q_of("policy.target");
  double sum = 0;
  int differing = 0;
  for (int j = 0; j < 16; ++j) {
    int best = 0, best_of_target = 0;
    for (int k = 1; k < 3; ++k) {
      if (batch.next_masks(k, j) > 0 && online(k, j) > online(best, j)) best = k;
      if (batch.next_masks(k, j) > 0 && target(k, j) > target(best_of_target, j)) best_of_target = k;
    }
    differing += best != best_of_target;
    sum += batch.rewards[j] + batch.discounts[j] * static_cast<double>(target(best, j));
  }
  ASSERT_GT(differing, 0) << "the two choices must not be told apart by luck";
  ASSERT_TRUE(ddqn.Update(batch, batch, batch).ok());
  EXPECT_STREQ(ddqn.metrics()[2].name, "train/target_mean");
  EXPECT_NEAR(ddqn.metrics()[2].value, sum / 16, 1e-5);
}

using DiscreteSacTinyProblem = TinyProblem;

// With a fixed temperature T the soft values are V(s) = T log sum_a exp(Q(s, a) / T), and pi is the softmax
// of Q / T.
TEST_F(DiscreteSacTinyProblem, ATwoStateChainHasItsClosedFormSoftValues) {
  constexpr double kTemperature = 0.5;
  config_.mutable_discrete_sac()->set_first_temperature(kTemperature);
  config_.mutable_discrete_sac()->set_temperature_learning_rate(0);
  Train(Chain(), 2, 2, 2000);
  const double v1 = kTemperature * std::log(std::exp(1 / kTemperature) + std::exp(-1 / kTemperature));
  const auto share = [&](double q, double other) { return 1 / (1 + std::exp((other - q) / kTemperature)); };
  EXPECT_NEAR(view_.q(0, 1), 1, 0.02);
  EXPECT_NEAR(view_.q(1, 1), -1, 0.02);
  EXPECT_NEAR(view_.q(0, 0), 0.9 * v1, 0.02);
  EXPECT_NEAR(view_.q(1, 0), 0.3, 0.02);
  EXPECT_NEAR(view_.policy(0, 1), share(1, -1), 0.02);
  EXPECT_NEAR(view_.policy(0, 0), share(0.9 * v1, 0.3), 0.02);
}

// Two of three actions are legal: the target is a share of log 2, not of log 3.
TEST_F(DiscreteSacTinyProblem, TheTemperatureBringsTheEntropyToItsTarget) {
  DiscreteSacConfig* sac = config_.mutable_discrete_sac();
  sac->set_temperature_learning_rate(3e-3);
  sac->set_target_entropy_ratio(0.5);
  const std::vector<Step> steps = {{0, 0, 0, 0, 0}, {0, 1, 1, 0, 0}};
  Train(steps, 1, 3, 3000, /*legal=*/2);
  EXPECT_NEAR(Metric("train/policy_entropy"), 0.5 * std::log(2.0), 0.01);
  EXPECT_GT(view_.policy(1, 0), 0.8f);
  EXPECT_EQ(view_.policy(2, 0), 0);
  // At this temperature the softmax of Q / T = (0, 1) / T has that entropy: T log(p / (1 - p)) = 1.
  const double p = view_.policy(1, 0);
  EXPECT_NEAR(Metric("train/temperature"), 1 / std::log(p / (1 - p)), 0.02);
}

}  // namespace
}  // namespace dbr
