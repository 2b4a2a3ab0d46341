// What every algorithm of the registry must do, and that DBR solves small problems with known answers.
#include "learner/algorithm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>

#include "learner/algorithms/discrete_dbr.h"
#include "nn/policy.h"
#include "tests/learner/allocation_count.h"
#include "tests/learner/batches.h"

namespace dbr {
namespace {

AlgorithmSpec SpecOf(const AlgorithmId& id, std::uint64_t seed = 1) {
  AlgorithmSpec spec = SmallSpec(seed, id.actions);
  if (id.name == "sac") spec.config.mutable_sac();
  EXPECT_EQ(AlgorithmName(spec.config), id.name) << "give the new algorithm its config here";
  return spec;
}

class Conformance : public testing::TestWithParam<AlgorithmId> {
 protected:
  Conformance() { algorithm_ = Make(1); }

  std::unique_ptr<Algorithm> Make(std::uint64_t seed) {
    auto algorithm = MakeAlgorithm(SpecOf(GetParam(), seed));
    EXPECT_TRUE(algorithm.ok()) << algorithm.status();
    return std::move(algorithm).value();
  }
  Batch Random(int n) { return RandomBatch<float>(SpecOf(GetParam()), n, rng_); }
  static TensorFile StateOf(const Algorithm& algorithm) {
    TensorFile file;
    algorithm.Save(&file);
    return file;
  }
  void Update(Algorithm* algorithm, int n = 16) {
    const Batch uniform = Random(n), plus = Random(n), minus = Random(n);
    ASSERT_TRUE(algorithm->Update({uniform, plus, minus}).ok());
  }

  Rng rng_{9};
  std::unique_ptr<Algorithm> algorithm_;
};

TEST_P(Conformance, SameSeedAndBatchesGiveTheSameState) {
  const auto twin = Make(1), other = Make(2);
  EXPECT_NE(StateOf(*algorithm_).tensors, StateOf(*other).tensors);
  for (int i = 0; i < 5; ++i) {
    rng_ = Rng(100 + static_cast<std::uint64_t>(i));
    Update(algorithm_.get());
    rng_ = Rng(100 + static_cast<std::uint64_t>(i));
    Update(twin.get());
  }
  EXPECT_EQ(StateOf(*algorithm_).tensors, StateOf(*twin).tensors);
}

TEST_P(Conformance, SavingAndLoadingContinuesBitForBit) {
  for (int i = 0; i < 3; ++i) Update(algorithm_.get());
  const auto loaded = Make(77);
  ASSERT_TRUE(loaded->Load(StateOf(*algorithm_)).ok());
  for (Algorithm* algorithm : {algorithm_.get(), loaded.get()}) {
    rng_ = Rng(5);
    for (int i = 0; i < 3; ++i) Update(algorithm);
  }
  EXPECT_EQ(StateOf(*algorithm_).tensors, StateOf(*loaded).tensors);
  EXPECT_EQ(StateOf(*algorithm_).metadata, StateOf(*loaded).metadata);
}

TEST_P(Conformance, LoadingNamesAMissingOrMisshapenTensor) {
  TensorFile file = StateOf(*algorithm_);
  const std::string name = file.tensors.begin()->first;
  file.tensors.begin()->second.pop_back();
  EXPECT_THAT(std::string(algorithm_->Load(file).message()), testing::HasSubstr(name));
  file.tensors.erase(file.tensors.begin());
  EXPECT_THAT(std::string(algorithm_->Load(file).message()), testing::HasSubstr(name));
}

TEST_P(Conformance, AnUpdateMovesEveryNetworkThatItExports) {
  PolicySnapshot before, after;
  algorithm_->ExportPolicy(&before);
  Update(algorithm_.get());
  algorithm_->ExportPolicy(&after);
  ASSERT_EQ(before.networks.size(), after.networks.size());
  for (std::size_t i = 0; i < before.networks.size(); ++i) {
    EXPECT_NE(before.networks[i].second, after.networks[i].second) << before.networks[i].first;
  }
  EXPECT_TRUE(PolicyNetworks::Create(after).ok());
}

TEST_P(Conformance, AcceptsABatchOfOneAndEmptyPartitions) {
  Update(algorithm_.get(), 1);
  const Batch uniform = Random(4), empty;
  EXPECT_TRUE(algorithm_->Update({uniform, empty, empty}).ok());
  EXPECT_EQ(algorithm_->advantages().size(), 4u);
}

TEST_P(Conformance, AnUpdateAllocatesNothing) {
  const Batch uniform = Random(16), plus = Random(16), minus = Random(16);
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(algorithm_->Update({uniform, plus, minus}).ok());
  if (!CountsAllocations()) GTEST_SKIP() << "allocations belong to the sanitizer in this build";
  const std::uint64_t before = AllocationCount();
  const bool ok = algorithm_->Update({uniform, plus, minus}).ok();
  EXPECT_EQ(AllocationCount() - before, 0u);
  EXPECT_TRUE(ok);
}

TEST_P(Conformance, ALossThatIsNotFiniteIsNamed) {
  Batch uniform = Random(16);
  const Batch other = Random(16);
  uniform.rewards[3] = NAN;
  const absl::Status status = algorithm_->Update({uniform, other, other});
  EXPECT_TRUE(absl::IsInternal(status));
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("critic_loss"));
}

TEST_P(Conformance, TwoThreadsGiveWhatOneGives) {
  TensorFile states[2];
  for (const int threads : {1, 2}) {
    AlgorithmSpec spec = SpecOf(GetParam());
    spec.config.set_threads(static_cast<std::uint32_t>(threads));
    const auto algorithm = MakeAlgorithm(spec);
    rng_ = Rng(3);
    for (int i = 0; i < 20; ++i) Update(algorithm->get());
    (*algorithm)->Save(&states[threads - 1]);
  }
  EXPECT_EQ(states[0].tensors, states[1].tensors);
}

INSTANTIATE_TEST_SUITE_P(Registry, Conformance, testing::ValuesIn(Algorithms()), [](const auto& info) {
  return info.param.name + (info.param.actions == ActionKind::kDiscrete ? "Discrete" : "Continuous");
});

TEST(Registry, RefusesAnActionSpaceThatTheAlgorithmDoesNotServe) {
  AlgorithmSpec spec = SmallSpec();
  spec.config.mutable_sac();
  EXPECT_THAT(std::string(MakeAlgorithm(spec).status().message()),
              testing::HasSubstr("serves the discrete actions of environment 'test' (dbr), found sac"));
}

TEST(Registry, OverDiscreteActionsAllThreeMmdsAreOne) {
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

// Observations far from 0 and of another scale give, but for rounding, what the same at home gives.
TEST(Normalized, TheScaleOfObservationsDoesNotMatter) {
  std::vector<float> policies[2];
  for (const int variant : {0, 1}) {
    AlgorithmSpec spec = SmallSpec(1, ActionKind::kContinuous);
    spec.config.mutable_sac();
    spec.normalize_observations = true;
    const auto algorithm = MakeAlgorithm(spec);
    ASSERT_TRUE(algorithm.ok());
    Rng rng(3);
    for (int i = 0; i < 5; ++i) {
      Batch batch = RandomBatch<float>(spec, 16, rng);
      if (variant == 1) {
        batch.observations = (8 * batch.observations.array() + 3).matrix().eval();
        batch.next_observations = (8 * batch.next_observations.array() + 3).matrix().eval();
      }
      ASSERT_TRUE((*algorithm)->Update({batch, batch, batch}).ok());
    }
    PolicySnapshot snapshot;
    (*algorithm)->ExportPolicy(&snapshot);
    policies[variant] = *snapshot.Find(kPolicyNetwork);
    const std::vector<float>& statistics = *snapshot.Find(kObservationNormalizer);
    ASSERT_EQ(statistics.size(), 10u);
    EXPECT_NEAR(statistics[0], variant == 1 ? 3 : 0,
                variant == 1 ? 1.6 : 0.2);  // the mean of 80 uniform draws
    EXPECT_NEAR(statistics[5], std::sqrt(3.0) / (variant == 1 ? 8 : 1), 0.3);
  }
  for (std::size_t i = 0; i < policies[0].size(); ++i) EXPECT_NEAR(policies[0][i], policies[1][i], 1e-4);
}

TEST(Normalized, ActingTakesTheStatisticsAlong) {
  AlgorithmSpec spec = SmallSpec(1, ActionKind::kContinuous);
  spec.config.mutable_sac();
  spec.normalize_observations = true;
  const auto algorithm = MakeAlgorithm(spec);
  Rng rng(3);
  const Batch batch = RandomBatch<float>(spec, 16, rng);
  ASSERT_TRUE((*algorithm)->Update({batch, batch, batch}).ok());
  PolicySnapshot with;
  (*algorithm)->ExportPolicy(&with);
  PolicySnapshot without = with;
  without.networks.pop_back();  // the statistics
  const auto act = [&](const PolicySnapshot& snapshot, const MatrixX<float>& observations) {
    PolicyRunner runner;
    MatrixX<float> actions(2, observations.cols());
    const auto policy = PolicyNetworks::Create(snapshot);
    EXPECT_TRUE(runner.Act(**policy, MODE, observations, MatrixX<float>(0, 16), rng, actions).ok());
    return actions;
  };
  const std::vector<float>& statistics = *with.Find(kObservationNormalizer);
  const Eigen::Map<const VectorX<float>> mean(statistics.data(), 5), scale(statistics.data() + 5, 5);
  const MatrixX<float> by_hand =
      ((batch.observations.colwise() - mean).array().colwise() * scale.array()).matrix();
  EXPECT_TRUE(act(with, batch.observations).isApprox(act(without, by_hand), 1e-5f));
  EXPECT_FALSE(act(with, batch.observations).isApprox(act(without, batch.observations), 1e-3f));
}

TEST(DiscreteDbr, WarmStartLeavesQOut) {
  // Policies that differ in their critics' data alone stay equal while Q is left out.
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

// Trains on transitions that are all drawn in each batch, partitioned by the newest advantages.
class TinyProblem : public testing::Test {
 protected:
  struct Step {
    int state, action;
    float reward, discount;
    int next_state;
  };

  void Train(const std::vector<Step>& steps, int states, int actions, int updates) {
    spec_ = SmallSpec();
    spec_.observation_size = states;
    spec_.actions.size = actions;
    spec_.hidden_sizes = {32, 32};
    spec_.config.set_learning_rate(3e-3);
    spec_.config.set_target_tau(0.05);
    DiscreteDbr<float> dbr(spec_);
    const Batch all = Fill(steps, actions, [](std::size_t) { return true; });
    Batch plus, minus;
    for (int i = 0; i < updates; ++i) {
      ASSERT_TRUE(dbr.Update(all, plus, minus).ok());
      plus = Fill(steps, actions, [&](std::size_t k) { return dbr.advantages()[k] >= 0; });
      minus = Fill(steps, actions, [&](std::size_t k) { return dbr.advantages()[k] <= 0; });
    }
    PolicySnapshot snapshot;
    dbr.ExportPolicy(&snapshot);
    const auto policy = PolicyNetworks::Create(snapshot);
    ASSERT_TRUE(policy.ok());
    view_ = runner_.View(**policy, MatrixX<float>::Identity(states, states),
                         MatrixX<float>::Ones(actions, states));
  }

  PolicyView view_;

 private:
  template <class Predicate>
  Batch Fill(const std::vector<Step>& steps, int actions, const Predicate& wanted) {
    std::vector<const Step*> chosen;
    for (std::size_t k = 0; k < steps.size(); ++k) {
      if (wanted(k)) chosen.push_back(&steps[k]);
    }
    Batch batch;
    batch.Resize({spec_.observation_size, 1, actions}, static_cast<Eigen::Index>(chosen.size()), false);
    batch.observations.setZero();
    batch.next_observations.setZero();
    batch.masks.setOnes();
    batch.next_masks.setOnes();
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const auto j = static_cast<Eigen::Index>(k);
      batch.observations(chosen[k]->state, j) = 1;
      batch.next_observations(chosen[k]->next_state, j) = 1;
      batch.actions(0, j) = static_cast<float>(chosen[k]->action);
      batch.rewards[j] = chosen[k]->reward;
      batch.discounts[j] = chosen[k]->discount;
    }
    return batch;
  }

  AlgorithmSpec spec_;
  PolicyRunner runner_;
};

TEST_F(TinyProblem, TheTwoBehavioursOfABanditSeparate) {
  std::vector<Step> steps;
  for (int copy = 0; copy < 4; ++copy) {
    for (int a = 0; a < 3; ++a) steps.push_back({0, a, a == 1 ? 1.0f : 0.0f, 0, 0});
  }
  Train(steps, 1, 3, 600);
  EXPECT_GT(view_.policy(1, 0), 0.9f);
  EXPECT_GT(view_.beta_plus(1, 0), 0.9f);
  EXPECT_LT(view_.beta_minus(1, 0), 0.2f);
  EXPECT_NEAR(view_.q(1, 0), 1, 0.05);
  EXPECT_NEAR(view_.q(0, 0), 0, 0.05);
}

TEST_F(TinyProblem, ATwoStateChainHasItsClosedFormValues) {
  // State 0: action 0 goes on to state 1 for nothing, action 1 ends with 0.3. State 1: action 0 ends with 1,
  // action 1 with -1. So Q*(1, .) = (1, -1) and Q*(0, .) = (0.9, 0.3) for a discount of 0.9.
  Train({{0, 0, 0, 0.9f, 1}, {0, 1, 0.3f, 0, 0}, {1, 0, 1, 0, 0}, {1, 1, -1, 0, 0}}, 2, 2, 1500);
  EXPECT_NEAR(view_.q(0, 1), 1, 0.05);
  EXPECT_NEAR(view_.q(1, 1), -1, 0.05);
  EXPECT_NEAR(view_.q(0, 0), 0.9, 0.05);
  EXPECT_NEAR(view_.q(1, 0), 0.3, 0.05);
  EXPECT_GT(view_.policy(0, 0), 0.9f);
  EXPECT_GT(view_.policy(0, 1), 0.9f);
}

}  // namespace
}  // namespace dbr
