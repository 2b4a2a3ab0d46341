// Tests which parts of DBR and SAC move in which update: the warm start, several updates of the critics for
// one of the policy, the temperature, the multiplier, and behaviours that are fitted to the batch itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "learner/algorithms/registry.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

class Schedule : public testing::TestWithParam<ActionKind> {
 protected:
  DbrConfig* dbr() { return spec_.config.mutable_dbr(); }
  SacConfig* sac() { return spec_.config.mutable_sac(); }

  void Start() {
    auto algorithm = MakeAlgorithm(spec_);
    ASSERT_TRUE(algorithm.ok()) << algorithm.status();
    algorithm_ = *std::move(algorithm);
  }
  Batch Random() { return RandomBatch<float>(spec_, 16, rng_); }
  void Update() {
    const Batch uniform = Random(), plus = Random(), minus = Random();
    ASSERT_TRUE(algorithm_->Update({uniform, plus, minus}).ok());
  }
  TensorFile State() const {
    TensorFile file;
    algorithm_->Save(&file);
    return file;
  }
  std::vector<float> Tensor(const std::string& name) const { return State().tensors.at(name); }
  double Metric(const std::string& name) const {
    for (const UpdateMetric& metric : algorithm_->metrics()) {
      if (metric.name == name) return metric.value;
    }
    ADD_FAILURE() << name;
    return 0;
  }
  // A multiplier's logarithm and the state of its Adam.
  using MultiplierState = std::pair<std::vector<float>, std::string>;
  static MultiplierState StateOf(const TensorFile& file, const std::string& multiplier) {
    MultiplierState state;
    for (const std::string part : {"", ".adam.first", ".adam.second"}) {
      state.first.push_back(file.tensors.at(multiplier + part)[0]);
    }
    state.second = file.metadata.at(multiplier + ".adam.steps");
    return state;
  }
  // Makes nine updates. Returns those, counted from 1, in which the named tensor changed.
  std::vector<int> UpdatesThatMove(const std::vector<std::string>& names) {
    std::vector<int> moved;
    for (int i = 1; i <= 9; ++i) {
      const TensorFile before = State();
      Update();
      const TensorFile after = State();
      EXPECT_EQ(algorithm_->advantages().size(), 16u);
      int changed = 0;
      for (const std::string& name : names) {
        changed += before.tensors.at(name) != after.tensors.at(name) ? 1 : 0;
      }
      EXPECT_TRUE(changed == 0 || changed == static_cast<int>(names.size())) << "in update " << i;
      if (changed > 0) moved.push_back(i);
    }
    return moved;
  }

  AlgorithmSpec spec_ = SmallSpec(1, GetParam());
  std::unique_ptr<Algorithm> algorithm_;
  Rng rng_{41};
};

TEST_P(Schedule, AThousandUpdatesOfWarmStartLeaveMultiplierAndTemperatureWhereTheyWere) {
  dbr()->set_first_temperature(0.5);
  dbr()->set_warm_start_updates(1000);
  Start();
  const TensorFile first = State();
  for (int i = 0; i < 1000; ++i) Update();
  const TensorFile warm = State();
  for (const std::string name : {"log_alpha", "log_temperature"}) {
    EXPECT_EQ(StateOf(warm, name), StateOf(first, name)) << name;
  }
  EXPECT_NE(warm.tensors.at("policy"), first.tensors.at("policy")) << "the constraint alone moves it";
  Update();
  for (const std::string name : {"log_alpha", "log_temperature"}) {
    EXPECT_NE(Tensor(name), first.tensors.at(name)) << name;
  }
}

TEST_P(Schedule, ThePolicyMovesInEveryKthUpdateAndTheCriticsInEach) {
  for (const int k : {1, 3}) {
    dbr()->set_updates_per_policy_update(static_cast<std::uint32_t>(k));
    dbr()->set_first_temperature(0.5);
    const std::vector<int> each = {1, 2, 3, 4, 5, 6, 7, 8, 9};
    const std::vector<int> kth = k == 1 ? each : std::vector<int>{3, 6, 9};
    Start();
    EXPECT_EQ(UpdatesThatMove({"policy", "policy.target", "log_alpha", "log_temperature"}), kth) << k;
    Start();
    EXPECT_EQ(UpdatesThatMove({"critic_1", "critic_2", "critic_1.target", "beta_plus", "beta_minus"}), each)
        << k;
  }
}

TEST_P(Schedule, SacsPolicyMovesInEveryKthUpdateAndItsCriticsInEach) {
  if (GetParam() == ActionKind::kDiscrete) GTEST_SKIP() << "SAC serves continuous actions";
  sac()->set_updates_per_policy_update(4);
  Start();
  EXPECT_EQ(UpdatesThatMove({"policy", "log_alpha"}), (std::vector<int>{4, 8}));
  Start();
  EXPECT_EQ(UpdatesThatMove({"critic_1", "critic_2", "critic_1.target"}),
            (std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

// An advantage is Q(s, a) - V(s) of its own update, whether the policy moves in it or not.
TEST_P(Schedule, EveryUpdateJudgesItsOwnBatch) {
  dbr()->set_updates_per_policy_update(3);
  dbr()->set_policy_samples(20);
  Start();
  std::vector<float> before;
  for (int i = 0; i < 6; ++i) {
    Update();
    const std::vector<float> now(algorithm_->advantages().begin(), algorithm_->advantages().end());
    EXPECT_NE(now, before) << i;
    for (const float advantage : now) EXPECT_LT(std::abs(advantage), 3) << i;
    before = now;
  }
}

TEST_P(Schedule, TheTemperatureRisesWhileTheEntropyIsBelowItsTargetAndFallsAbove) {
  dbr()->set_first_temperature(0.5);
  dbr()->set_temperature_learning_rate(0.01);
  for (const bool below : {true, false}) {
    dbr()->set_target_entropy(below ? 5 : -50);
    dbr()->set_target_entropy_ratio(below ? 1 : 0);
    Start();
    double before = 0.5;
    for (int i = 0; i < 20; ++i) {
      Update();
      const double now = Metric("train/temperature");
      EXPECT_EQ(now > before, below) << now << " after " << before << " in update " << i;
      before = now;
    }
    EXPECT_NEAR(std::log(before / 0.5), below ? 0.2 : -0.2, 0.05);
  }
}

TEST_P(Schedule, WithoutAFirstTemperatureThereIsNone) {
  dbr()->set_entropy_weight(0.1);
  Start();
  for (int i = 0; i < 3; ++i) Update();
  EXPECT_EQ(Metric("train/temperature"), 0);
  EXPECT_EQ(State().tensors.count("log_temperature"), 0u);
}

TEST_P(Schedule, ATemperatureNeedsNoConstraint) {
  dbr()->set_constraint(DbrConfig::NONE);
  dbr()->set_first_temperature(0.5);
  Start();
  const MultiplierState multiplier = StateOf(State(), "log_alpha");
  for (int i = 0; i < 3; ++i) Update();
  EXPECT_NE(Metric("train/temperature"), 0.5);
  EXPECT_EQ(StateOf(State(), "log_alpha"), multiplier);
}

TEST_P(Schedule, ACheckpointWithoutATemperatureLacksIt) {
  Start();
  const TensorFile without = State();
  dbr()->set_first_temperature(0.5);
  Start();
  const absl::Status status = algorithm_->Load(without);
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("'log_temperature'"));
}

TEST_P(Schedule, TheMultiplierStaysWithinItsLimits) {
  dbr()->set_multiplier_learning_rate(0.2);
  dbr()->set_constraint(DbrConfig::FIXED);
  dbr()->set_min_multiplier(0);
  dbr()->set_max_multiplier(2);
  for (const bool rises : {true, false}) {
    dbr()->set_epsilon(rises ? 1e-9 : 100);
    Start();
    for (int i = 0; i < 300; ++i) Update();
    EXPECT_NEAR(Metric("train/multiplier"), rises ? 2 : 0, rises ? 1e-6 : 0);
  }
}

TEST_P(Schedule, BehavioursFittedToTheBatchNeedNoDrawsFromThePartitions) {
  dbr()->set_behavior_data(DbrConfig::BATCH);
  Start();
  EXPECT_EQ(algorithm_->needs().uniform, 16);
  EXPECT_EQ(algorithm_->needs().plus, 0);
  EXPECT_EQ(algorithm_->needs().minus, 0);
}

// A step of a behaviour is made with the transitions of its own part, by the advantages of the same update.
TEST_P(Schedule, BehavioursFittedToTheBatchSeeTheirOwnPartAlone) {
  dbr()->set_behavior_data(DbrConfig::BATCH);
  spec_.config.set_learning_rate(1e-8);  // so that no other network moves the advantages
  const Batch none, uniform = Random();
  const auto gradients = [&](const Batch& batch) {
    Start();
    EXPECT_TRUE(algorithm_->Update({batch, none, none}).ok());
    return std::pair(Tensor("beta_plus.adam.first"), Tensor("beta_minus.adam.first"));
  };
  const auto [plus, minus] = gradients(uniform);
  const std::vector<float> advantages(algorithm_->advantages().begin(), algorithm_->advantages().end());
  EXPECT_THAT(advantages, testing::Contains(testing::Gt(0)));
  EXPECT_THAT(advantages, testing::Contains(testing::Lt(0)));
  Batch changed = uniform;
  for (std::size_t j = 0; j < advantages.size(); ++j) {
    if (advantages[j] >= 0) changed.observations.col(static_cast<Eigen::Index>(j)) *= 1.01f;
  }
  const auto [moved_plus, moved_minus] = gradients(changed);
  for (std::size_t j = 0; j < advantages.size(); ++j) {
    ASSERT_EQ(algorithm_->advantages()[j] >= 0, advantages[j] >= 0) << "the parts are the same ones";
  }
  EXPECT_NE(moved_plus, plus);
  EXPECT_EQ(moved_minus, minus) << "no transition of D- has changed";
}

TEST_P(Schedule, WhatAPhaseSetsHoldsAndIsNotLearned) {
  dbr()->set_first_temperature(0.5);
  Start();
  Update();
  const MultiplierState multiplier = StateOf(State(), "log_alpha"),
                        temperature = StateOf(State(), "log_temperature");
  algorithm_->SetControls({.multiplier = 7, .temperature = 0.25});
  for (int i = 0; i < 3; ++i) Update();
  EXPECT_EQ(Metric("train/multiplier"), 7);
  EXPECT_EQ(Metric("train/temperature"), 0.25);
  EXPECT_EQ(StateOf(State(), "log_alpha"), multiplier);
  EXPECT_EQ(StateOf(State(), "log_temperature"), temperature);
  algorithm_->SetControls({});
  Update();
  EXPECT_NE(StateOf(State(), "log_alpha"), multiplier);
  EXPECT_NE(StateOf(State(), "log_temperature"), temperature);
}

TEST_P(Schedule, TheTemperatureAimsAtTheEntropyThatAPhaseSets) {
  if (spec_.actions.discrete()) GTEST_SKIP() << "its target is a share";
  dbr()->set_first_temperature(0.5);
  double temperatures[2];
  for (const double target : {-100, 100}) {
    Start();
    algorithm_->SetControls({.target_entropy = target});
    for (int i = 0; i < 5; ++i) Update();
    temperatures[target > 0 ? 1 : 0] = Metric("train/temperature");
  }
  EXPECT_LT(temperatures[0], 0.5);
  EXPECT_GT(temperatures[1], 0.5);
}

INSTANTIATE_TEST_SUITE_P(Actions, Schedule, testing::Values(ActionKind::kDiscrete, ActionKind::kContinuous),
                         [](const auto& info) {
                           return info.param == ActionKind::kDiscrete ? "Discrete" : "Continuous";
                         });

}  // namespace
}  // namespace dbr
