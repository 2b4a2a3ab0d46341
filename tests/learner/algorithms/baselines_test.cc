// Tests BRAC, TD3, TD3+BC, ReBRAC, AWAC, IQL and Cal-QL: what an update changes, and that each solves a
// bandit with a known optimum.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "nn/policy.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

AlgorithmSpec BaselineSpec(AlgorithmConfig::AlgorithmCase algorithm) {
  AlgorithmSpec spec = SmallSpec(1, ActionKind::kContinuous);
  if (algorithm == AlgorithmConfig::kBrac) spec.config.mutable_brac();
  if (algorithm == AlgorithmConfig::kTd3) spec.config.mutable_td3();
  if (algorithm == AlgorithmConfig::kAwac) spec.config.mutable_awac();
  if (algorithm == AlgorithmConfig::kTd3Bc) spec.config.mutable_td3_bc();
  if (algorithm == AlgorithmConfig::kRebrac) spec.config.mutable_rebrac();
  if (algorithm == AlgorithmConfig::kIql) spec.config.mutable_iql();
  if (algorithm == AlgorithmConfig::kCalQl) spec.config.mutable_cal_ql()->set_conservative_actions(4);
  return spec;
}

std::unique_ptr<Algorithm> Make(const AlgorithmSpec& spec) {
  auto algorithm = MakeAlgorithm(spec);
  EXPECT_TRUE(algorithm.ok()) << algorithm.status();
  return std::move(algorithm).value();
}

TensorFile StateOf(const Algorithm& algorithm) {
  TensorFile file;
  algorithm.Save(&file);
  return file;
}

double Metric(const Algorithm& algorithm, const std::string& name) {
  for (const UpdateMetric& metric : algorithm.metrics()) {
    if (metric.name == name) return metric.value;
  }
  ADD_FAILURE() << "no metric " << name;
  return 0;
}

// Makes `updates` updates on random batches that depend only on their number.
std::unique_ptr<Algorithm> Trained(const AlgorithmSpec& spec, int updates) {
  auto algorithm = Make(spec);
  Rng rng(3);
  for (int i = 0; i < updates; ++i) {
    const Batch batch = RandomBatch<float>(spec, 16, rng);
    EXPECT_TRUE(algorithm->Update({batch, batch, batch}).ok());
  }
  return algorithm;
}

TEST(Brac, ThePolicysStepLeavesTheBehaviourAndTheCriticsAlone) {
  AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kBrac);
  const TensorFile weak = StateOf(*Trained(spec, 1));
  spec.config.mutable_brac()->set_first_multiplier(100);
  const TensorFile strong = StateOf(*Trained(spec, 1));
  EXPECT_NE(weak.tensors.at("policy.adam.first"), strong.tensors.at("policy.adam.first"));
  for (const char* name : {"behavior", "behavior.adam.first", "critic_1", "critic_1.adam.first",
                           "critic_1.target", "critic_2", "critic_2.adam.first"}) {
    EXPECT_EQ(weak.tensors.at(name), strong.tensors.at(name)) << name;
  }
}

TEST(Brac, TheValuePenaltyLowersTheTargetInProportionToTheMultiplier) {
  double target[3];
  for (const int penalties : {0, 1, 2}) {
    AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kBrac);
    BracConfig* config = spec.config.mutable_brac();
    config->set_variant(penalties == 0 ? BracConfig::PR : BracConfig::VP);
    config->set_first_multiplier(std::max(penalties, 1));
    target[penalties] = Metric(*Trained(spec, 1), "train/target_mean");
  }
  EXPECT_NE(target[0], target[1]);
  EXPECT_NEAR(target[0] - target[2], 2 * (target[0] - target[1]), 1e-5);
}

TEST(Brac, WarmStartLeavesQOut) {
  // Policies whose critics see different rewards stay equal while Q is left out.
  std::vector<float> policies[2];
  for (const int variant : {0, 1}) {
    AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kBrac);
    spec.config.set_reward_scale(1 + 9 * variant);
    spec.config.mutable_brac()->set_warm_start_updates(3);
    policies[variant] = StateOf(*Trained(spec, 3)).tensors.at("policy");
  }
  EXPECT_EQ(policies[0], policies[1]);
}

TEST(Brac, TheMultiplierMovesOnlyWhereItIsAdaptive) {
  for (const bool adaptive : {false, true}) {
    AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kBrac);
    spec.config.mutable_brac()->set_adaptive_multiplier(adaptive);
    spec.config.mutable_brac()->set_epsilon(1000);  // far above any divergence, so the multiplier must fall
    const double multiplier = Metric(*Trained(spec, 5), "train/multiplier");
    if (adaptive) {
      EXPECT_LT(multiplier, 0.999);
    } else {
      EXPECT_EQ(multiplier, 1);
    }
  }
}

TEST(Td3, PolicyAndTargetsMoveEveryDelayedUpdate) {
  AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kTd3);
  spec.config.mutable_td3()->set_policy_delay(3);
  TensorFile before = StateOf(*Trained(spec, 0));
  for (int updates = 1; updates <= 7; ++updates) {
    const TensorFile after = StateOf(*Trained(spec, updates));
    EXPECT_NE(after.tensors.at("critic_1"), before.tensors.at("critic_1"));
    for (const char* name : {"policy", "policy.target", "critic_1.target", "critic_2.target"}) {
      const bool moved = after.tensors.at(name) != before.tensors.at(name);
      EXPECT_EQ(moved, updates % 3 == 1) << name << " at update " << updates;
    }
    before = after;
  }
}

TEST(Td3, SamplingGivesTheMode) {
  AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kTd3);
  spec.config.set_learning_rate(0.01);
  PolicySnapshot snapshot;
  Trained(spec, 20)->ExportPolicy(&snapshot);
  const auto policy = PolicyNetworks::Create(snapshot);
  ASSERT_TRUE(policy.ok());
  Rng rng(4);
  const MatrixX<float> observations = RandomBatch<float>(spec, 8, rng).observations;
  PolicyRunner runner;
  MatrixX<float> sampled(2, 8), mode(2, 8);
  const MatrixX<float> no_masks(0, 8);
  ASSERT_TRUE(runner.Act(**policy, SAMPLE, observations, no_masks, rng, sampled).ok());
  ASSERT_TRUE(runner.Act(**policy, MODE, observations, no_masks, rng, mode).ok());
  EXPECT_LT((sampled - mode).cwiseAbs().maxCoeff(), 1e-6f);
}

TEST(Td3, WithoutNoiseTheTargetIsThatOfTheTargetPolicysAction) {
  AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kTd3);
  const auto target_mean = [&](double noise, double limit) {
    spec.config.mutable_td3()->set_target_noise(noise);
    spec.config.mutable_td3()->set_target_noise_limit(limit);
    return Metric(*Trained(spec, 1), "train/target_mean");
  };
  EXPECT_EQ(target_mean(0, 0.5), target_mean(0.2, 0));
  EXPECT_NE(target_mean(0, 0.5), target_mean(0.2, 0.5));
}

TEST(Awac, NoWeightPassesItsLimit) {
  AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kAwac);
  spec.config.mutable_awac()->set_temperature(1e-3);
  spec.config.mutable_awac()->set_max_weight(5);
  const auto algorithm = Trained(spec, 3);
  EXPECT_NEAR(Metric(*algorithm, "train/weight_max"), 5, 1e-4);
  EXPECT_LT(Metric(*algorithm, "train/weight_mean"), 5);
}

TEST(Rebrac, TheTargetLosesTheDistanceToTheNextActionInProportionToThePenalty) {
  double target[3];
  for (const int penalties : {0, 1, 2}) {
    AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kRebrac);
    spec.config.mutable_rebrac()->set_critic_penalty(penalties);
    target[penalties] = Metric(*Trained(spec, 1), "train/target_mean");
  }
  EXPECT_GT(target[0], target[1]);
  EXPECT_NEAR(target[0] - target[2], 2 * (target[0] - target[1]), 1e-4);
}

TEST(Rebrac, WithoutPenaltiesItIsTd3WithNormalisedValues) {
  AlgorithmSpec rebrac = BaselineSpec(AlgorithmConfig::kRebrac), td3 = BaselineSpec(AlgorithmConfig::kTd3);
  rebrac.config.mutable_rebrac()->set_policy_penalty(0);
  rebrac.config.mutable_rebrac()->set_critic_penalty(0);
  const TensorFile one = StateOf(*Trained(rebrac, 1)), other = StateOf(*Trained(td3, 1));
  EXPECT_EQ(one.tensors.at("critic_1"), other.tensors.at("critic_1"));
  EXPECT_NE(one.tensors.at("policy.adam.first"), other.tensors.at("policy.adam.first"));
}

TEST(Td3Bc, ASmallerWeightOfQStaysNearerToTheData) {
  double distance[2];
  for (const int strong : {0, 1}) {
    AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kTd3Bc);
    spec.config.set_learning_rate(0.01);
    spec.config.mutable_td3_bc()->set_q_weight(strong == 1 ? 100 : 0);
    distance[strong] = Metric(*Trained(spec, 100), "train/action_distance");
  }
  EXPECT_LT(distance[0], 0.8 * distance[1]);
}

TEST(CalQl, ReturnsAboveEveryValueTakeThePushOffThePolicysActions) {
  std::vector<float> critics[2];
  for (const bool calibrated : {false, true}) {
    AlgorithmSpec spec = BaselineSpec(AlgorithmConfig::kCalQl);
    spec.config.mutable_cal_ql()->set_calibrated(calibrated);
    critics[calibrated ? 1 : 0] = StateOf(*Trained(spec, 1)).tensors.at("critic_1.adam.first");
  }
  EXPECT_NE(critics[0], critics[1]);
}

// A bandit: one state, one step, one dimension. The actions are given, and the reward is a function of them.
class Bandit : public testing::Test {
 protected:
  static constexpr int kActions = 32, kUpdates = 1200;

  static AlgorithmSpec Spec(AlgorithmConfig::AlgorithmCase algorithm) {
    AlgorithmSpec spec = BaselineSpec(algorithm);
    spec.observation_size = 1;
    spec.actions.size = 1;
    spec.hidden_sizes = {32, 32};
    spec.config.set_learning_rate(3e-3);
    spec.config.set_learning_rate_decay_updates(kUpdates);
    return spec;
  }

  // Trains on all actions at once. Stores the policy's Gaussian before the tanh in mean_ and deviation_.
  template <class Reward>
  void Train(const AlgorithmSpec& spec, const VectorX<float>& actions, const Reward& reward) {
    Batch batch;
    batch.Resize({1, 1, 0}, actions.size(), /*with_keys=*/false);
    batch.observations.setOnes();
    batch.next_observations.setOnes();
    batch.discounts.setZero();
    batch.actions = actions.transpose();
    for (Eigen::Index j = 0; j < actions.size(); ++j) batch.rewards[j] = reward(actions[j]);
    algorithm_ = Make(spec);
    for (int i = 0; i < kUpdates; ++i) ASSERT_TRUE(algorithm_->Update({batch, batch, batch}).ok());
    PolicySnapshot snapshot;
    algorithm_->ExportPolicy(&snapshot);
    MlpActivations<float> activations;
    const MatrixX<float>& output =
        MlpForward<float>(MlpShape(1, spec.hidden_sizes, 2), snapshot.Find(kPolicyNetwork)->data(),
                          MatrixX<float>::Ones(1, 1), &activations);
    mean_ = output(0, 0);
    deviation_ = std::exp(output(1, 0));
  }

  static VectorX<float> UniformActions() { return VectorX<float>::LinSpaced(kActions, -0.98f, 0.98f); }
  // Returns tanh of the quantiles of a normal with mean 0: the same distribution as draws, without chance.
  static VectorX<float> NormalActions(double deviation) {
    VectorX<float> actions(kActions);
    for (int i = 0; i < kActions; ++i) {
      double low = -8, high = 8;
      while (high - low > 1e-9) {
        const double middle = (low + high) / 2;
        const double below = std::erfc(-middle / std::numbers::sqrt2) / 2;
        (below < (i + 0.5) / kActions ? low : high) = middle;
      }
      actions[i] = static_cast<float>(std::tanh(deviation * low));
    }
    return actions;
  }

  std::unique_ptr<Algorithm> algorithm_;
  double mean_ = 0, deviation_ = 0;
};

TEST_F(Bandit, Td3FindsTheBestAction) {
  // The reward is a tent. At the flat top of a parabola, a small error of the critic would move the greatest
  // value far.
  const auto reward = [](float a) { return -std::abs(a - 0.4f); };
  Train(Spec(AlgorithmConfig::kTd3), UniformActions(), reward);
  EXPECT_NEAR(std::tanh(mean_), 0.4, 0.05);
}

TEST_F(Bandit, Td3BcStandsBetweenTheDataAndTheBestAction) {
  // The data's mean action is 0, the best one 0.4, and Q is about -1.2 between them. The tent's slope of 1,
  // times q_weight / 1.2, meets the pull's slope of 2 a.
  const auto reward = [](float a) { return -std::abs(a - 0.4f) - 1; };
  AlgorithmSpec spec = Spec(AlgorithmConfig::kTd3Bc);
  spec.config.mutable_td3_bc()->set_q_weight(0.5);
  Train(spec, UniformActions(), reward);
  EXPECT_NEAR(std::tanh(mean_), 0.5 / (2 * 1.2), 0.05);
  spec.config.mutable_td3_bc()->set_q_weight(50);
  Train(spec, UniformActions(), reward);
  EXPECT_NEAR(std::tanh(mean_), 0.4, 0.05);
}

TEST_F(Bandit, TheConservativeTermKeepsThePolicyWhereTheDataIs) {
  // The reward rises without end. The data stays within +-0.4.
  const auto reward = [](float a) { return 2 * a; };
  AlgorithmSpec spec = Spec(AlgorithmConfig::kCalQl);
  CalQlConfig* config = spec.config.mutable_cal_ql();
  config->set_calibrated(false);
  config->set_first_temperature(0.02);
  config->set_temperature_learning_rate(0);
  config->set_conservative_weight(0);
  Train(spec, NormalActions(0.2), reward);
  EXPECT_GT(std::tanh(mean_), 0.8);
  config->set_conservative_weight(5);
  Train(spec, NormalActions(0.2), reward);
  EXPECT_LT(std::tanh(mean_), 0.5);
}

TEST_F(Bandit, IqlFindsTheExpectileOfTheDatasValues) {
  // Rewards are uniform in [-0.98, 0.98]. The expectile e of a uniform on [-b, b] is b (sqrt(e) - sqrt(1 -
  // e)) / (sqrt(e) + sqrt(1 - e)).
  AlgorithmSpec spec = Spec(AlgorithmConfig::kIql);
  spec.config.mutable_iql()->set_expectile(0.9);
  Train(spec, UniformActions(), [](float a) { return a; });
  const double high = std::sqrt(0.9), low = std::sqrt(0.1);
  EXPECT_NEAR(Metric(*algorithm_, "train/value_mean"), 0.98 * (high - low) / (high + low), 0.05);
}

TEST_F(Bandit, IqlFitsTheDataWeightedByItsAdvantages) {
  AlgorithmSpec spec = Spec(AlgorithmConfig::kIql);
  spec.config.mutable_iql()->set_temperature(0.02);
  spec.config.mutable_iql()->set_max_weight(1e9);
  const auto reward = [](float a) { return -(a - 0.4f) * (a - 0.4f); };
  Train(spec, UniformActions(), reward);
  EXPECT_NEAR(std::tanh(mean_), 0.4, 0.05);
  EXPECT_NEAR(deviation_, 0.1 / (1 - 0.4 * 0.4), 0.05);
}

TEST_F(Bandit, AwacFitsTheDataWeightedByItsAdvantages) {
  // With uniform actions and the reward -(a - 0.4)^2 the weighted data is a normal with variance lambda / 2.
  AlgorithmSpec spec = Spec(AlgorithmConfig::kAwac);
  spec.config.mutable_awac()->set_temperature(0.02);
  spec.config.mutable_awac()->set_value_samples(4);
  const auto reward = [](float a) { return -(a - 0.4f) * (a - 0.4f); };
  Train(spec, UniformActions(), reward);
  EXPECT_NEAR(std::tanh(mean_), 0.4, 0.05);
  EXPECT_NEAR(deviation_, 0.1 / (1 - 0.4 * 0.4), 0.04);  // 0.1 times the slope of atanh
}

TEST_F(Bandit, AwacsLikelihoodOfASingleActionStaysBounded) {
  AlgorithmSpec spec = Spec(AlgorithmConfig::kAwac);
  spec.config.mutable_awac()->set_max_weight(1);
  const auto reward = [](float) { return 0.5f; };
  Train(spec, VectorX<float>::Constant(kActions, 0.3f), reward);
  EXPECT_NEAR(std::tanh(mean_), 0.3, 0.01);
  // The greatest logarithm of the density: at the mean, with the log-std at its lower limit.
  const double greatest = 5 - 0.9189 - std::log(1 - 0.3 * 0.3);
  EXPECT_GE(Metric(*algorithm_, "train/actor_loss"), -greatest - 1e-3);
}

TEST_F(Bandit, BracTradesRewardForDivergence) {
  // Before the tanh the behaviour is N(0, 0.5^2) and the reward is u. So the optimum, proportional to beta
  // exp(u / alpha), is N(0.5^2 / alpha, 0.5^2).
  AlgorithmSpec spec = Spec(AlgorithmConfig::kBrac);
  spec.config.mutable_brac()->set_first_multiplier(0.5);
  const auto reward = [](float a) { return std::atanh(a); };
  Train(spec, NormalActions(0.5), reward);
  EXPECT_NEAR(mean_, 0.5, 0.1);
  EXPECT_NEAR(deviation_, 0.5, 0.1);
  EXPECT_NEAR(Metric(*algorithm_, "train/divergence"), 0.5, 0.2);  // mean^2 / (2 * 0.5^2)
}

TEST_F(Bandit, BracsAdaptiveMultiplierHoldsTheDivergenceAtEpsilon) {
  // A divergence of 0.5 nats is a shift of the mean by one standard deviation.
  AlgorithmSpec spec = Spec(AlgorithmConfig::kBrac);
  spec.config.mutable_brac()->set_adaptive_multiplier(true);
  spec.config.mutable_brac()->set_epsilon(0.5);
  spec.config.mutable_brac()->set_multiplier_learning_rate(0.01);
  const auto reward = [](float a) { return 3 * std::atanh(a); };
  Train(spec, NormalActions(0.5), reward);
  EXPECT_NEAR(mean_, 0.5, 0.1);
  EXPECT_NEAR(deviation_, 0.5, 0.1);
  EXPECT_NEAR(Metric(*algorithm_, "train/multiplier"), 3 * 0.5 * 0.5 / 0.5, 0.5);
}

}  // namespace
}  // namespace dbr
