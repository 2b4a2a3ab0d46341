// Tests what online DBR's loss adds: the limit of the repulsion from beta-, what a warm start leaves out, and
// the partition of a batch.
#include <gtest/gtest.h>

#include "learner/objectives/batch_partition.h"
#include "learner/objectives/discrete_losses.h"
#include "learner/objectives/dual_behavior_objective.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;

constexpr int kStates = 6, kObservation = 3, kDimensions = 2;
constexpr double kAlpha = 1.7;

Matrix Normal(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

PolicyLossOptions Repelling(DbrConfig::Divergence divergence, double max_repulsion) {
  return {.constraint = DbrConfig::DYNAMIC_MAX,
          .divergence = divergence,
          .epsilon = 1e-6,
          .repel_negative = true,
          .max_repulsion = max_repulsion,
          .entropy_weight = 0.2};
}

// The value between the smallest and the largest divergence of a state, so that it cuts some of them.
double Middle(const VectorX<double>& values) {
  return (values.minCoeff() + values.maxCoeff()) / 2;
}

class Repulsion : public testing::TestWithParam<DbrConfig::Divergence> {};

TEST_P(Repulsion, OverDiscreteActionsStopsAtItsLimitStateByState) {
  Rng rng(41);
  const Matrix masks = Matrix::Ones(4, kStates);
  const auto softmax = [&](const Matrix& logits) {
    Categorical<double> categorical;
    MaskedSoftmax<double>(logits, masks, &categorical);
    return categorical;
  };
  const Matrix q1 = Normal(4, kStates, rng), q2 = Normal(4, kStates, rng), logits = Normal(4, kStates, rng);
  const Categorical<double> plus = softmax(Normal(4, kStates, rng)),
                            minus = softmax(2 * Normal(4, kStates, rng));
  VectorX<double> away;
  Divergence<double>(GetParam(), 1, softmax(logits), minus, &away, nullptr);
  const double limit = Middle(away);
  const auto loss = [&](const Matrix& at, Matrix* gradient) {
    PolicyLossWorkspace<double> workspace;
    return DualBehaviorPolicyLoss<double>(Repelling(GetParam(), limit), softmax(at), q1, q2, plus, minus,
                                          kAlpha, &workspace, gradient);
  };
  Matrix gradient, unused;
  const PolicyLoss<double> at = loss(logits, &gradient);
  EXPECT_NEAR(at.threshold, away.cwiseMin(limit).mean(), 1e-12);
  EXPECT_NEAR(at.divergence_minus, away.mean(), 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& moved) { return loss(moved, &unused).loss; }, logits);
}

TEST_P(Repulsion, OverContinuousActionsStopsAtItsLimitStateByState) {
  Rng rng(42);
  PairRunner runner(1);
  CriticEnsemble<double> critics(MlpShape(kObservation + kDimensions, {6, 6}, 1),
                                 {.learning_rate = 1e-3, .with_target = true}, rng, &runner);
  const Matrix observations = Normal(kObservation, kStates, rng);
  const ObjectiveNoise<double> noise{Normal(kDimensions, kStates, rng), {}, {}, {}};
  GaussianHead<double> plus, minus;
  plus.Split(0.5 * Normal(2 * kDimensions, kStates, rng), kBehaviorLogStd);
  minus.Split(0.5 * Normal(2 * kDimensions, kStates, rng), kBehaviorLogStd);
  const Matrix output = 0.5 * Normal(2 * kDimensions, kStates, rng);
  GaussianHead<double> pi;
  pi.Split(output, kPolicyLogStd);
  GaussianDivergence<double> divergence;
  divergence.Compute({GetParam(), 1}, pi, minus, {noise.pi, noise.minus});
  const VectorX<double> away = divergence.value();
  const double limit = Middle(away);
  DualBehaviorObjective<double> objective;
  const auto loss = [&](const Matrix& at, Matrix* gradient) {
    pi.Split(at, kPolicyLogStd);
    return objective.Compute(Repelling(GetParam(), limit), {pi, plus, minus}, observations, noise, kAlpha,
                             &critics, gradient);
  };
  Matrix gradient, unused;
  const PolicyLoss<double> at = loss(output, &gradient);
  EXPECT_NEAR(at.threshold, away.cwiseMin(limit).mean(), 1e-12);
  EXPECT_NEAR(at.divergence_minus, away.mean(), 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& moved) { return loss(moved, &unused).loss; }, output);
}

INSTANTIATE_TEST_SUITE_P(Divergences, Repulsion,
                         testing::Values(DbrConfig::KL, DbrConfig::MMD_EXACT, DbrConfig::MMD_SQUARED),
                         [](const auto& info) { return DbrConfig::Divergence_Name(info.param); });

TEST(WarmStart, LeavesOutTheEntropyWithQ) {
  Rng rng(43);
  const Matrix masks = Matrix::Ones(3, kStates);
  Categorical<double> pi, beta;
  MaskedSoftmax<double>(Normal(3, kStates, rng), masks, &pi);
  MaskedSoftmax<double>(Normal(3, kStates, rng), masks, &beta);
  const Matrix q = Normal(3, kStates, rng);
  PolicyLossOptions options = Repelling(DbrConfig::KL, 0);
  options.use_q = false;
  PolicyLossWorkspace<double> workspace;
  Matrix with, without;
  const auto one = DualBehaviorPolicyLoss<double>(options, pi, q, q, beta, beta, kAlpha, &workspace, &with);
  options.entropy_weight = 0;
  const auto other =
      DualBehaviorPolicyLoss<double>(options, pi, q, q, beta, beta, kAlpha, &workspace, &without);
  EXPECT_EQ(with, without);
  EXPECT_EQ(one.loss, other.loss);
}

TEST(BatchPartition, WeighsTheMembersOfEachPartAlike) {
  BatchPartition<double> partition;
  partition.Split({2, -1, 0, -0.1f}, 0);
  EXPECT_EQ(partition.plus(), Eigen::Vector4d(2, 0, 2, 0));
  EXPECT_TRUE(partition.minus().isApprox(Eigen::Vector4d(0, 4.0 / 3, 4.0 / 3, 4.0 / 3)));
  partition.Split({2, -1, 0, -0.1f}, 0.5f);
  EXPECT_EQ(partition.minus(), Eigen::Vector4d(0, 4, 0, 0));
  partition.Split({2, 1, 3, 1}, 0);
  EXPECT_TRUE(partition.has_plus());
  EXPECT_FALSE(partition.has_minus());
}

}  // namespace
}  // namespace dbr
