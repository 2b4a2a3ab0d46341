// Tests what each input of DBR's update may change. Two updates start from the same state and differ in one
// input; the test compares their tensors. A gradient that flows where it should not changes one tensor too
// many.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>

#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

using testing::IsEmpty;
using testing::UnorderedElementsAre;

struct Batches {
  Batch uniform, plus, minus;
};

class StopGradients : public testing::TestWithParam<ActionKind> {
 protected:
  StopGradients() { dbr().set_constraint(DbrConfig::FIXED); }

  DbrConfig& dbr() { return *spec_.config.mutable_dbr(); }
  bool discrete() const { return GetParam() == ActionKind::kDiscrete; }

  // Returns the state after one update.
  TensorFile Updated(const AlgorithmSpec& spec, const Batches& batches) {
    const auto algorithm = MakeAlgorithm(spec);
    EXPECT_TRUE(algorithm.ok()) << algorithm.status();
    EXPECT_TRUE((*algorithm)->Update({batches.uniform, batches.plus, batches.minus}).ok());
    TensorFile file;
    (*algorithm)->Save(&file);
    return file;
  }
  // Returns the names of the networks with a tensor that differs: "policy", "critics", "beta_plus",
  // "beta_minus", "log_alpha".
  static std::set<std::string> Differing(const TensorFile& one, const TensorFile& other) {
    std::set<std::string> names;
    for (const auto& [name, tensor] : one.tensors) {
      if (tensor == other.tensors.at(name)) continue;
      const std::string network = name.substr(0, name.find('.'));
      names.insert(network == kCritic1 || network == kCritic2 ? "critics" : network);
    }
    return names;
  }
  std::set<std::string> MovedByBatches(const std::function<void(Batches*)>& change) {
    Batches changed = batches_;
    change(&changed);
    return Differing(Updated(spec_, batches_), Updated(spec_, changed));
  }
  std::set<std::string> MovedByConfig(const std::function<void(DbrConfig*)>& change) {
    AlgorithmSpec changed = spec_;
    change(changed.config.mutable_dbr());
    return Differing(Updated(spec_, batches_), Updated(changed, batches_));
  }
  std::set<std::string> MovedByPlus() {
    return MovedByBatches([&](Batches* batches) { batches->plus = RandomBatch<float>(spec_, 16, rng_); });
  }
  std::set<std::string> MovedByMinus() {
    return MovedByBatches([&](Batches* batches) { batches->minus = RandomBatch<float>(spec_, 16, rng_); });
  }

  Rng rng_{21};
  AlgorithmSpec spec_ = SmallSpec(1, GetParam());
  const Batches batches_{RandomBatch<float>(spec_, 16, rng_), RandomBatch<float>(spec_, 16, rng_),
                         RandomBatch<float>(spec_, 16, rng_)};
};

TEST_P(StopGradients, TheSameUpdateTwiceMovesNothingApart) {
  EXPECT_THAT(MovedByBatches([](Batches*) {}), IsEmpty());
}

TEST_P(StopGradients, DMinusMovesBetaMinusAloneWhereTheConstraintIsFixed) {
  EXPECT_THAT(MovedByMinus(), UnorderedElementsAre("beta_minus"));
}

TEST_P(StopGradients, DMinusReachesADynamicThresholdAndSoTheMultiplier) {
  dbr().set_constraint(DbrConfig::DYNAMIC_MAX);
  dbr().set_epsilon(1e-9);  // D(pi, beta-) is the larger one
  // The multiplier's first step has the same size for any violation. The moments of its Adam show the
  // difference.
  EXPECT_THAT(MovedByMinus(), UnorderedElementsAre("beta_minus", "log_alpha"));
}

TEST_P(StopGradients, DMinusReachesThePolicyOnlyWhereItRepels) {
  dbr().set_constraint(DbrConfig::DYNAMIC_MAX);
  dbr().set_epsilon(1e-9);
  dbr().set_repel_negative(true);
  EXPECT_THAT(MovedByMinus(), UnorderedElementsAre("beta_minus", "log_alpha", "policy"));
}

TEST_P(StopGradients, DPlusMovesBetaPlusAndWhatIsHeldToItButNotTheCritics) {
  EXPECT_THAT(MovedByPlus(), UnorderedElementsAre("beta_plus", "policy", "log_alpha"));
}

TEST_P(StopGradients, WithAValuePenaltyDPlusMovesTheCriticsToo) {
  dbr().set_value_penalty(true);
  EXPECT_THAT(MovedByPlus(), UnorderedElementsAre("beta_plus", "policy", "log_alpha", "critics"));
}

// The discrete policy's step uses the critics from before their step, so it does not see the rewards of this
// update. The continuous one uses the critics after their step.
TEST_P(StopGradients, RewardsMoveTheCriticsAndNeitherBehaviour) {
  const auto moved = MovedByBatches([](Batches* batches) { batches->uniform.rewards *= 2; });
  if (discrete()) {
    EXPECT_THAT(moved, UnorderedElementsAre("critics"));
  } else {
    EXPECT_THAT(moved, UnorderedElementsAre("critics", "policy"));
  }
}

TEST_P(StopGradients, RewardsOfDPlusAndDMinusMoveNothing) {
  EXPECT_THAT(MovedByBatches([](Batches* batches) {
                batches->plus.rewards *= 2;
                batches->minus.rewards *= 2;
                batches->plus.discounts.setZero();
                batches->minus.next_observations *= -1;
              }),
              IsEmpty());
}

TEST_P(StopGradients, ThePolicysLossMovesThePolicyAlone) {
  EXPECT_THAT(MovedByConfig([](DbrConfig* config) { config->set_entropy_weight(1); }),
              UnorderedElementsAre("policy"));
  EXPECT_THAT(MovedByConfig([](DbrConfig* config) { config->set_normalize_q(true); }),
              UnorderedElementsAre("policy"));
}

// In the warm start the multiplier stands still.
TEST_P(StopGradients, TheWarmStartMovesThePolicyAloneAndHoldsTheMultiplier) {
  EXPECT_THAT(MovedByConfig([](DbrConfig* config) { config->set_warm_start_updates(10); }),
              UnorderedElementsAre("policy", "log_alpha"));
  dbr().set_warm_start_updates(10);
  EXPECT_THAT(MovedByPlus(), UnorderedElementsAre("beta_plus", "policy"));
}

TEST_P(StopGradients, TheTemperatureIsInThePolicysLossAndInTheTarget) {
  dbr().set_first_temperature(0.5);
  EXPECT_THAT(MovedByConfig([](DbrConfig* config) { config->set_first_temperature(2); }),
              UnorderedElementsAre("policy", "critics", "log_temperature"));
  EXPECT_THAT(MovedByPlus(), UnorderedElementsAre("beta_plus", "policy", "log_alpha"));
}

TEST_P(StopGradients, TheTargetEntropyMovesTheTemperatureAlone) {
  dbr().set_first_temperature(0.5);
  EXPECT_THAT(MovedByConfig([](DbrConfig* config) {
                config->set_target_entropy(5);
                config->set_target_entropy_ratio(0.1);
              }),
              UnorderedElementsAre("log_temperature"));
}

TEST_P(StopGradients, TheMultiplierWeighsThePolicysConstraintAndNothingElse) {
  EXPECT_THAT(MovedByConfig([](DbrConfig* config) { config->set_first_multiplier(3); }),
              UnorderedElementsAre("policy", "log_alpha"));
}

TEST_P(StopGradients, ThePolicyStepLeavesItsTargetToPolyakAveraging) {
  spec_.config.set_target_tau(0.25);
  const auto algorithm = MakeAlgorithm(spec_);
  TensorFile before, after;
  (*algorithm)->Save(&before);
  ASSERT_TRUE((*algorithm)->Update({batches_.uniform, batches_.plus, batches_.minus}).ok());
  (*algorithm)->Save(&after);
  for (const std::string network : {kPolicyNetwork, kCritic1, kCritic2}) {
    const std::vector<float>& first = before.tensors.at(network + ".target");
    const std::vector<float>& online = after.tensors.at(network);
    const std::vector<float>& target = after.tensors.at(network + ".target");
    EXPECT_NE(online, before.tensors.at(network));
    for (std::size_t i = 0; i < target.size(); ++i) {
      ASSERT_NEAR(target[i], 0.75f * first[i] + 0.25f * online[i], 1e-6f) << network;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Actions, StopGradients,
                         testing::Values(ActionKind::kDiscrete, ActionKind::kContinuous),
                         [](const auto& info) {
                           return info.param == ActionKind::kDiscrete ? "Discrete" : "Continuous";
                         });

}  // namespace
}  // namespace dbr
