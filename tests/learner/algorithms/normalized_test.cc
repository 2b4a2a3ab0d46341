// Tests algorithms whose observations are normalized.
#include "learner/algorithms/normalized.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/rng.h"
#include "learner/algorithms/registry.h"
#include "nn/policy.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

// Observations far from 0 and at another scale give the same results, except for rounding.
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
                variant == 1 ? 1.6 : 0.2);  // within the error of the mean of 80 uniform draws
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
  without.networks.pop_back();  // removes the statistics
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

}  // namespace
}  // namespace dbr
