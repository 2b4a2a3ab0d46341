// Tests what every algorithm of the registry must do.
#include "learner/algorithm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "absl/strings/match.h"
#include "learner/algorithms/registry.h"
#include "learner/training/learning_rate.h"
#include "nn/policy.h"
#include "nn/product/product_library.h"
#include "tests/learner/algorithms/allocation_count.h"
#include "tests/learner/algorithms/batches.h"
#include "tests/learner/algorithms/members.h"

namespace dbr {
namespace {

class Conformance : public testing::TestWithParam<Member> {
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
  for (int i = 0; i < 4; ++i) Update(algorithm_.get());  // 4: within a cycle of 3
  const auto loaded = Make(77);
  ASSERT_TRUE(loaded->Load(StateOf(*algorithm_)).ok());
  for (Algorithm* algorithm : {algorithm_.get(), loaded.get()}) {
    rng_ = Rng(5);
    for (int i = 0; i < 4; ++i) Update(algorithm);
  }
  EXPECT_EQ(StateOf(*algorithm_).tensors, StateOf(*loaded).tensors);
  EXPECT_EQ(StateOf(*algorithm_).metadata, StateOf(*loaded).metadata);
}

TEST_P(Conformance, TheStateOfTheOtherPrecisionIsContinued) {
  if (!HasBfloat16()) GTEST_SKIP() << "the processor has no bfloat16";
  Member other = GetParam();
  other.bfloat16 = !other.bfloat16;
  const auto before = MakeAlgorithm(SpecOf(other));
  for (int i = 0; i < 3; ++i) Update(before->get());
  ASSERT_TRUE(algorithm_->Load(StateOf(**before)).ok());
  EXPECT_EQ(StateOf(*algorithm_).tensors, StateOf(**before).tensors);
  for (const auto& algorithm : {algorithm_.get(), before->get()}) {
    rng_ = Rng(5);
    Update(algorithm);
  }
  EXPECT_NE(StateOf(*algorithm_).tensors, StateOf(**before).tensors) << "the precision has no effect";
}

TEST_P(Conformance, LoadingNamesAMissingOrMisshapenTensor) {
  TensorFile file = StateOf(*algorithm_);
  const std::string name = file.tensors.begin()->first;
  file.tensors.begin()->second.pop_back();
  EXPECT_THAT(std::string(algorithm_->Load(file).message()), testing::HasSubstr(name));
  file.tensors.erase(file.tensors.begin());
  EXPECT_THAT(std::string(algorithm_->Load(file).message()), testing::HasSubstr(name));
}

// Critics with layer normalisation have other sizes: a state of the other kind is refused.
TEST_P(Conformance, AStateWithOtherwiseNormalisedCriticsIsRefusedByName) {
  if (GetParam().id.name == "ddqn") GTEST_SKIP() << "it has no critics apart from its policy";
  AlgorithmSpec spec = SpecOf(GetParam());
  spec.critic_layer_norm = !spec.critic_layer_norm;
  const auto other = MakeAlgorithm(spec);
  ASSERT_TRUE(other.ok()) << other.status();
  const absl::Status status = algorithm_->Load(StateOf(**other));
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("tensor 'critic_1'"));
}

TEST_P(Conformance, ACycleOfUpdatesMovesEveryNetworkThatItExports) {
  PolicySnapshot before, after;
  algorithm_->ExportPolicy(&before);
  for (int i = 0; i < CycleOf(SpecOf(GetParam()).config); ++i) Update(algorithm_.get());
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

// Gives an action that is illegal everywhere the value 10^6 in every network. Nothing else changes, to the
// last bit, and no mode plays it.
TEST_P(Conformance, AnIllegalActionIsNeitherLearnedFromNorChosen) {
  if (GetParam().id.actions != ActionKind::kDiscrete) GTEST_SKIP() << "every action is legal";
  constexpr int kIllegal = 2;
  PolicySnapshot snapshot;
  algorithm_->ExportPolicy(&snapshot);
  const std::size_t parameters = snapshot.Find(kPolicyNetwork)->size();
  const auto set_bias = [&](float value, TensorFile file) {
    for (auto& [name, tensor] : file.tensors) {
      const bool network = tensor.size() == parameters || absl::StartsWith(name, "critic_");
      if (network && !absl::StrContains(name, ".adam.")) tensor[tensor.size() - 3 + kIllegal] = value;
    }
    return file;
  };
  const auto tempted = Make(1);
  ASSERT_TRUE(tempted->Load(set_bias(1e6f, StateOf(*tempted))).ok());
  for (int i = 0; i < 3; ++i) {
    Batch batch = Random(16);
    batch.masks.row(kIllegal).setZero();
    batch.next_masks.row(kIllegal).setZero();
    batch.actions = batch.actions.cwiseMin(1);
    ASSERT_TRUE(algorithm_->Update({batch, batch, batch}).ok());
    ASSERT_TRUE(tempted->Update({batch, batch, batch}).ok());
  }
  EXPECT_EQ(set_bias(0, StateOf(*tempted)).tensors, set_bias(0, StateOf(*algorithm_)).tensors);

  tempted->ExportPolicy(&snapshot);
  const auto policy = PolicyNetworks::Create(snapshot);
  PolicyRunner runner;
  MatrixX<float> actions(1, 16), masks = MatrixX<float>::Ones(3, 16);
  masks.row(kIllegal).setZero();
  for (const ActingMode mode : {SAMPLE, MODE, GREEDY_Q, SUPPORT}) {
    if (mode == SUPPORT && !(*policy)->has_dual_behavior()) continue;
    ASSERT_TRUE(runner.Act(**policy, mode, Random(16).observations, masks, rng_, actions).ok());
    EXPECT_LT(actions.maxCoeff(), kIllegal);
  }
}

TEST_P(Conformance, AnUpdateAllocatesNothing) {
  const Batch uniform = Random(16), plus = Random(16), minus = Random(16);
  const AlgorithmConfig config = SpecOf(GetParam()).config;
  const int first_uses = CycleOf(config) == 1 && EnoughFor(config) == 4 ? 2 : EnoughFor(config);
  for (int i = 0; i < first_uses; ++i) ASSERT_TRUE(algorithm_->Update({uniform, plus, minus}).ok());
  if (!CountsAllocations()) GTEST_SKIP() << "allocations belong to the sanitizer in this build";
  const std::uint64_t before = AllocationCount();
  bool ok = true;
  for (int i = 0; i < CycleOf(config); ++i) ok = algorithm_->Update({uniform, plus, minus}).ok() && ok;
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

// True where an algorithm's own updates read the target of its policy. The others keep it for evaluations
// alone, which find a NaN in it when they act.
bool ReadsPolicyTarget(const std::string& algorithm) {
  return algorithm != "sac" && algorithm != "discrete_sac" && algorithm != "awac" && algorithm != "iql" &&
         algorithm != "cal_ql";
}

// One NaN anywhere in the state (a network, a target, a moment of Adam, the multiplier) reaches the figures
// of one of the next updates: nothing on the way takes the other, finite side.
TEST_P(Conformance, ANaNInTheStateEndsTraining) {
  const int enough = EnoughFor(SpecOf(GetParam()).config);  // TD3's policy moves in every second update
  Update(algorithm_.get());
  const TensorFile sound = StateOf(*algorithm_);
  const bool multiplied = GetParam().variant != "Mrl" && GetParam().id.name != "brac";  // else it is constant
  for (const auto& [name, values] : sound.tensors) {
    if (absl::StartsWith(name, "log_alpha") && !multiplied) continue;
    if (name == "policy.target" && !ReadsPolicyTarget(GetParam().id.name)) continue;
    // The end of a policy may be the bias of a log-std that nothing reads.
    const std::size_t last = absl::StartsWith(name, "critic") ? values.size() - 1 : 0;
    for (const std::size_t place : {std::size_t{0}, last}) {
      TensorFile damaged = sound;
      damaged.tensors[name][place] = NAN;
      const auto algorithm = Make(1);
      ASSERT_TRUE(algorithm->Load(damaged).ok());
      absl::Status status;
      for (int i = 0; i < enough && status.ok(); ++i) {
        const Batch uniform = Random(16), plus = Random(16), minus = Random(16);
        status = algorithm->Update({uniform, plus, minus});
      }
      EXPECT_TRUE(absl::IsInternal(status)) << name << " at " << place << " of " << values.size();
    }
  }
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

INSTANTIATE_TEST_SUITE_P(Registry, Conformance, testing::ValuesIn(Members()), [](const auto& info) {
  const AlgorithmId& id = info.param.id;
  return id.name + (id.actions == ActionKind::kDiscrete ? "Discrete" : "Continuous") + info.param.variant +
         (info.param.bfloat16 ? "Bfloat16" : "");
});

TEST(LearningRateTest, FallsLinearlyToItsEndAndStaysThere) {
  AlgorithmConfig config;
  config.set_learning_rate(0.1);
  config.set_final_learning_rate(0.02);
  EXPECT_EQ(LearningRate(config, 1000), 0.1) << "it never falls";
  config.set_learning_rate_decay_updates(40);
  EXPECT_EQ(LearningRate(config, 0), 0.1);
  EXPECT_NEAR(LearningRate(config, 10), 0.08, 1e-12);
  EXPECT_NEAR(LearningRate(config, 39), 0.022, 1e-12);
  EXPECT_EQ(LearningRate(config, 40), 0.02);
  EXPECT_EQ(LearningRate(config, 1000), 0.02);
}

// A learning rate that has fallen to 0 changes no parameter any more.
TEST(LearningRateTest, ThatHasFallenTo0MovesNoPolicy) {
  for (const AlgorithmId& id : Algorithms()) {
    std::vector<float> policies[2];
    for (const int decayed : {0, 1}) {
      AlgorithmSpec spec = SpecOf({id, ""});
      if (decayed == 1) {
        spec.config.set_learning_rate_decay_updates(2);
        spec.config.set_final_learning_rate(0);
      }
      const auto algorithm = MakeAlgorithm(spec);
      ASSERT_TRUE(algorithm.ok()) << algorithm.status();
      Rng rng(5);
      PolicySnapshot before, after;
      for (int i = 0; i < 6; ++i) {
        const Batch batch = RandomBatch<float>(spec, 16, rng);
        if (i == 2) (*algorithm)->ExportPolicy(&before);
        ASSERT_TRUE((*algorithm)->Update({batch, batch, batch}).ok());
      }
      (*algorithm)->ExportPolicy(&after);
      if (decayed == 1) {
        EXPECT_EQ(*before.Find(kPolicyNetwork), *after.Find(kPolicyNetwork)) << id.name;
      }
      policies[decayed] = *after.Find(kPolicyNetwork);
    }
    EXPECT_NE(policies[0], policies[1]) << id.name;
  }
}

TEST(Registry, RefusesAnActionSpaceThatTheAlgorithmDoesNotServe) {
  AlgorithmSpec spec = SmallSpec();
  spec.config.mutable_sac();
  EXPECT_THAT(
      std::string(MakeAlgorithm(spec).status().message()),
      testing::ContainsRegex("serves the discrete actions of environment 'test' \\(dbr.*\\), found sac$"));
}

}  // namespace
}  // namespace dbr
