// Tests DBR's temperature and multiplier over the updates of a run, and how often it improves its policy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <string>

#include "learner/algorithms/registry.h"
#include "learner/objectives/greatest_target.h"
#include "nn/categorical.h"
#include "nn/policy_networks.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

using testing::HasSubstr;
using Matrix = MatrixX<double>;

class OnlineDbr : public testing::TestWithParam<ActionKind> {
 protected:
  std::unique_ptr<Algorithm> Make(const std::function<void(DbrConfig*)>& set) {
    spec_ = SmallSpec(1, GetParam());
    set(spec_.config.mutable_dbr());
    auto algorithm = MakeAlgorithm(spec_);
    EXPECT_TRUE(algorithm.ok()) << algorithm.status();
    return std::move(algorithm).value();
  }
  void Update(Algorithm* algorithm, int count = 1) {
    for (int i = 0; i < count; ++i) {
      const Batch uniform = RandomBatch<float>(spec_, 16, rng_), plus = RandomBatch<float>(spec_, 16, rng_),
                  minus = RandomBatch<float>(spec_, 16, rng_);
      ASSERT_TRUE(algorithm->Update({uniform, plus, minus}).ok());
    }
  }
  static double Metric(const Algorithm& algorithm, const std::string& name) {
    for (const UpdateMetric& metric : algorithm.metrics()) {
      if (metric.name == name) return metric.value;
    }
    ADD_FAILURE() << "no metric " << name;
    return 0;
  }
  static std::vector<float> Network(const Algorithm& algorithm, const char* name) {
    PolicySnapshot snapshot;
    algorithm.ExportPolicy(&snapshot);
    return *snapshot.Find(name);
  }

  AlgorithmSpec spec_;
  Rng rng_{5};
};

TEST_P(OnlineDbr, AWarmStartLeavesTheMultiplierAndTheTemperatureWhereTheyWere) {
  const auto dbr = Make([](DbrConfig* config) {
    config->set_first_multiplier(100);
    config->set_first_temperature(0.5);
    config->set_warm_start_updates(1000);
  });
  Update(dbr.get(), 1000);
  EXPECT_NEAR(Metric(*dbr, "train/multiplier"), 100, 1e-3);
  EXPECT_NEAR(Metric(*dbr, "train/temperature"), 0.5, 1e-6);
  Update(dbr.get(), 2);  // the metrics are those from before the step
  EXPECT_GT(std::abs(Metric(*dbr, "train/multiplier") - 100), 0.05);
  EXPECT_GT(std::abs(Metric(*dbr, "train/temperature") - 0.5), 1e-5);
}

TEST_P(OnlineDbr, TheTemperatureRisesBelowItsEntropyAndFallsAboveIt) {
  for (const bool above : {false, true}) {
    const auto dbr = Make([above](DbrConfig* config) {
      config->set_first_temperature(0.5);
      config->set_target_entropy(above ? -20 : 20);
      config->set_target_entropy_ratio(above ? 0 : 1);
    });
    Update(dbr.get(), 20);
    EXPECT_EQ(Metric(*dbr, "train/temperature") < 0.5, above);
  }
}

TEST_P(OnlineDbr, ThereIsNoTemperatureUnlessItIsAskedFor) {
  const auto dbr = Make([](DbrConfig*) {});
  Update(dbr.get(), 2);
  EXPECT_EQ(Metric(*dbr, "train/temperature"), 0);
}

TEST_P(OnlineDbr, APolicyThatIsImprovedInEveryThirdUpdateStandsStillInTheOthers) {
  const auto dbr = Make([](DbrConfig* config) {
    config->set_updates_per_policy_update(3);
    config->set_first_temperature(0.5);
  });
  for (int update = 1; update <= 9; ++update) {
    const std::vector<float> policy = Network(*dbr, kPolicyNetwork), critic = Network(*dbr, kCritic1);
    Update(dbr.get());
    EXPECT_EQ(Network(*dbr, kPolicyNetwork) != policy, update % 3 == 0) << update;
    EXPECT_NE(Network(*dbr, kCritic1), critic);
    EXPECT_EQ(dbr->advantages().size(), 16u);
  }
}

TEST_P(OnlineDbr, BehavioursOfTheBatchNeedNoDrawsFromThePartitions) {
  const auto dbr = Make([](DbrConfig* config) { config->set_behavior_data(DbrConfig::BATCH); });
  EXPECT_EQ(dbr->needs().plus, 0);
  EXPECT_EQ(dbr->needs().minus, 0);
  const std::vector<float> plus = Network(*dbr, kBetaPlus), minus = Network(*dbr, kBetaMinus);
  Update(dbr.get());
  EXPECT_NE(Network(*dbr, kBetaPlus), plus);
  EXPECT_NE(Network(*dbr, kBetaMinus), minus);
}

TEST_P(OnlineDbr, ACheckpointWithoutATemperatureIsRefusedByName) {
  TensorFile file;
  Make([](DbrConfig*) {})->Save(&file);
  const absl::Status status = Make([](DbrConfig* config) { config->set_first_temperature(1); })->Load(file);
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), HasSubstr("log_temperature"));
}

INSTANTIATE_TEST_SUITE_P(Actions, OnlineDbr, testing::Values(ActionKind::kDiscrete, ActionKind::kContinuous),
                         [](const auto& info) {
                           return info.param == ActionKind::kDiscrete ? "Discrete" : "Continuous";
                         });

// y is higher by discount * tau * H(pi'(.|s')) than without a temperature.
TEST(SoftTarget, OfDiscreteActionsHasTheEntropyOnTop) {
  constexpr double kTau = 0.7;
  double target_mean[2];
  AlgorithmSpec spec = SmallSpec();
  Rng rng(6);
  const Batch batch = RandomBatch<float>(spec, 16, rng);
  PolicySnapshot snapshot;
  for (const bool soft : {false, true}) {
    if (soft) spec.config.mutable_dbr()->set_first_temperature(kTau);
    const auto dbr = *MakeAlgorithm(spec);
    dbr->ExportPolicy(&snapshot);
    ASSERT_TRUE(dbr->Update({batch, batch, batch}).ok());
    for (const UpdateMetric& metric : dbr->metrics()) {
      if (metric.name == std::string("train/target_mean")) target_mean[soft] = metric.value;
    }
  }
  MlpActivations<float> activations;
  const MatrixX<float> logits =
      MlpForward<float>(MlpShape(spec.observation_size, spec.hidden_sizes, spec.actions.size),
                        snapshot.Find(kPolicyNetwork)->data(), batch.next_observations, &activations);
  double expected = 0;
  for (int j = 0; j < 16; ++j) {
    double sum = 0, entropy = 0;
    for (int a = 0; a < 3; ++a) sum += batch.next_masks(a, j) * std::exp(logits(a, j));
    for (int a = 0; a < 3; ++a) {
      const double p = batch.next_masks(a, j) * std::exp(logits(a, j)) / sum;
      if (p > 0) entropy -= p * std::log(p);
    }
    expected += batch.discounts[j] * kTau * entropy / 16;
  }
  EXPECT_NEAR(target_mean[1] - target_mean[0], expected, 1e-5);
}

// V' is the greatest of the draws' values less the price of their log-probability, by a plain loop.
TEST(SoftTarget, OfContinuousActionsIsTheGreatestSoftValueOfTheDraws) {
  constexpr int kStates = 5, kObservation = 3, kDimensions = 2;
  constexpr double kTau = 0.4, kMinWeight = 0.75;
  Rng rng(7);
  PairRunner runner(1);
  const TrainingOptions options{.learning_rate = 1e-3, .with_target = true};
  TrainedNetwork<double> policy(MlpShape(kObservation, {6}, 2 * kDimensions), options, rng);
  CriticEnsemble<double> critics(MlpShape(kObservation + kDimensions, {6}, 1), options, rng, &runner);
  const auto normal = [&](int rows, int cols) -> Matrix {
    return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
  };
  const Matrix states = normal(kObservation, kStates);
  for (const int draws : {1, 3}) {
    const Matrix noise = normal(kDimensions, draws * kStates);
    GreatestTarget<double> target;
    target.EvaluatePolicy(states, &policy);
    const VectorX<double> value = target.Compute(states, noise, kMinWeight, &critics, kTau);
    const Matrix output = policy.Evaluate(states);
    for (int j = 0; j < kStates; ++j) {
      double greatest = -1e9;
      for (int k = 0; k < draws; ++k) {
        Matrix input(kObservation + kDimensions, 1);
        input.topRows(kObservation) = states.col(j);
        double log_prob = 0;
        for (int d = 0; d < kDimensions; ++d) {
          const double e = noise(d, k * kStates + j), log_std = output(kDimensions + d, j);
          const double action = std::tanh(output(d, j) + std::exp(log_std) * e);
          input(kObservation + d, 0) = action;
          log_prob += -e * e / 2 - log_std - std::log(2 * M_PI) / 2 - std::log(1 - action * action);
        }
        critics.EvaluateTargets(input);
        const double q1 = critics.target1()(0, 0), q2 = critics.target2()(0, 0);
        greatest = std::max(
            greatest, kMinWeight * std::min(q1, q2) + (1 - kMinWeight) * std::max(q1, q2) - kTau * log_prob);
      }
      EXPECT_NEAR(value[j], greatest, 1e-9);
    }
  }
}

}  // namespace
}  // namespace dbr
