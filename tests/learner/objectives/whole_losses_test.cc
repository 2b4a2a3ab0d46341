// Tests DBR's whole policy loss by differences in double, for each constraint with each divergence, with
// repel_negative and normalize_q on and off. discrete_losses_test and continuous_losses_test test single
// cases of these. Epsilon is such that D(pi, beta-) is the threshold of both dynamic constraints.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "core/rng.h"
#include "learner/objectives/discrete_losses.h"
#include "learner/objectives/dual_behavior_objective.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Grid = std::tuple<DbrConfig::Constraint, DbrConfig::Divergence, bool, bool>;

constexpr int kStates = 4;
constexpr double kEntropyWeight = 0.2;

Matrix Normal(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

PolicyLossOptions OptionsOf(const Grid& grid) {
  const auto [constraint, divergence, repel_negative, normalize_q] = grid;
  return {.constraint = constraint,
          .divergence = divergence,
          .epsilon = constraint == DbrConfig::DYNAMIC_MIN ? 50 : 1e-4,
          .mmd_sigma = 1.5,
          .repel_negative = repel_negative,
          .normalize_q = normalize_q,
          .entropy_weight = kEntropyWeight};
}

// Returns alpha, which is 0 without a constraint.
double AlphaOf(const Grid& grid) {
  return std::get<0>(grid) == DbrConfig::NONE ? 0 : 1.7;
}

std::string NameOf(const testing::TestParamInfo<Grid>& info) {
  const auto [constraint, divergence, repel_negative, normalize_q] = info.param;
  return DbrConfig::Constraint_Name(constraint) + "_" + DbrConfig::Divergence_Name(divergence) +
         (repel_negative ? "_Repels" : "") + (normalize_q ? "_NormalizesQ" : "");
}

// Returns the loss at `moved`, computed again from its terms. Everything that the definition holds constant
// is taken from `at`, the point of the gradient: the scale of Q, and the threshold unless repel_negative is
// set.
double Objective(const Grid& grid, const PolicyLoss<double>& moved, const PolicyLoss<double>& at,
                 double scale) {
  const auto [constraint, divergence, repel_negative, normalize_q] = grid;
  const bool dynamic = constraint == DbrConfig::DYNAMIC_MAX || constraint == DbrConfig::DYNAMIC_MIN;
  const double threshold = dynamic && repel_negative ? moved.divergence_minus : at.threshold;
  return -(moved.value + kEntropyWeight * moved.entropy) / (normalize_q ? scale : 1) +
         AlphaOf(grid) * (moved.divergence_plus - threshold);
}

void ExpectTheThresholdIsBetaMinuss(const Grid& grid, const PolicyLoss<double>& loss) {
  const DbrConfig::Constraint constraint = std::get<0>(grid);
  if (constraint != DbrConfig::DYNAMIC_MAX && constraint != DbrConfig::DYNAMIC_MIN) return;
  EXPECT_EQ(loss.threshold, loss.divergence_minus);
}

class DiscreteLoss : public testing::TestWithParam<Grid> {};

TEST_P(DiscreteLoss, GradientAgreesWithDifferences) {
  constexpr int kActions = 4;
  Rng rng(31);
  Matrix masks = Matrix::Ones(kActions, kStates);
  masks(2, 1) = 0;
  const auto softmax = [&](const Matrix& logits) {
    Categorical<double> p;
    MaskedSoftmax<double>(logits, masks, &p);
    return p;
  };
  const Matrix q1 = Normal(kActions, kStates, rng), q2 = Normal(kActions, kStates, rng);
  const Categorical<double> plus = softmax(Normal(kActions, kStates, rng)),
                            minus = softmax(Normal(kActions, kStates, rng));
  const Matrix logits = Normal(kActions, kStates, rng);
  const auto loss = [&](const Matrix& at, Matrix* gradient) {
    PolicyLossWorkspace<double> workspace;
    return DualBehaviorPolicyLoss<double>(OptionsOf(GetParam()), softmax(at), q1, q2, plus, minus,
                                          AlphaOf(GetParam()), &workspace, gradient);
  };
  const Matrix p = softmax(logits).probabilities;
  double scale = 0;  // the mean under pi of the absolute value of the twin with the smaller expectation
  for (int j = 0; j < kStates; ++j) {
    const auto& smaller = p.col(j).dot(q1.col(j)) <= p.col(j).dot(q2.col(j)) ? q1 : q2;
    scale += p.col(j).dot(smaller.col(j).cwiseAbs()) / kStates;
  }
  Matrix gradient, unused;
  const PolicyLoss<double> at = loss(logits, &gradient);
  ExpectTheThresholdIsBetaMinuss(GetParam(), at);
  EXPECT_NEAR(at.loss, Objective(GetParam(), at, at, scale), 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& moved) { return Objective(GetParam(), loss(moved, &unused), at, scale); },
      logits);
}

class ContinuousLoss : public testing::TestWithParam<Grid> {};

TEST_P(ContinuousLoss, GradientAgreesWithDifferences) {
  constexpr int kObservation = 3, kDimensions = 2, kDraws = 3;
  Rng rng(32);
  PairRunner runner(1);
  CriticEnsemble<double> critics(MlpShape(kObservation + kDimensions, {6, 6}, 1),
                                 {.learning_rate = 1e-3, .with_target = true}, rng, &runner);
  const Matrix observations = Normal(kObservation, kStates, rng);
  const auto noise = [&] { return Normal(kDimensions, kDraws * kStates, rng); };
  const ObjectiveNoise<double> draws{noise(), noise(), noise(), noise()};
  GaussianHead<double> plus, minus;
  plus.Split(0.5 * Normal(2 * kDimensions, kStates, rng), kBehaviorLogStd);
  minus.Split(0.5 * Normal(2 * kDimensions, kStates, rng), kBehaviorLogStd);
  const Matrix output = 0.5 * Normal(2 * kDimensions, kStates, rng);
  DualBehaviorObjective<double> objective;
  const auto loss = [&](const Matrix& at, Matrix* gradient) {
    GaussianHead<double> pi;
    pi.Split(at, kPolicyLogStd);
    return objective.Compute(OptionsOf(GetParam()), {pi, plus, minus}, observations, draws,
                             AlphaOf(GetParam()), &critics, gradient);
  };
  Matrix gradient, unused;
  const PolicyLoss<double> at = loss(output, &gradient);
  double scale = 0;  // the mean over states of the absolute value of the smaller twin's mean over the draws
  for (int j = 0; j < kStates; ++j) {
    double mean1 = 0, mean2 = 0;
    for (int k = j; k < kDraws * kStates; k += kStates) {
      mean1 += critics.value1()(0, k) / kDraws;
      mean2 += critics.value2()(0, k) / kDraws;
    }
    scale += std::abs(std::min(mean1, mean2)) / kStates;
  }
  ExpectTheThresholdIsBetaMinuss(GetParam(), at);
  EXPECT_NEAR(at.loss, Objective(GetParam(), at, at, scale), 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& moved) { return Objective(GetParam(), loss(moved, &unused), at, scale); },
      output);
}

const auto kConstraints =
    testing::Values(DbrConfig::DYNAMIC_MAX, DbrConfig::DYNAMIC_MIN, DbrConfig::FIXED, DbrConfig::NONE);

INSTANTIATE_TEST_SUITE_P(Grid, DiscreteLoss,
                         testing::Combine(kConstraints, testing::Values(DbrConfig::KL, DbrConfig::MMD_EXACT),
                                          testing::Bool(), testing::Bool()),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(Grid, ContinuousLoss,
                         testing::Combine(kConstraints,
                                          testing::Values(DbrConfig::KL, DbrConfig::MMD_EXACT,
                                                          DbrConfig::MMD_LAPLACIAN, DbrConfig::MMD_GAUSSIAN),
                                          testing::Bool(), testing::Bool()),
                         NameOf);

}  // namespace
}  // namespace dbr
