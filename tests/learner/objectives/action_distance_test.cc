// Tests the divergence ACTIONS: the distance of a policy's mode to the actions of a batch, and how much each
// of them counts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/rng.h"
#include "learner/objectives/action_weights.h"
#include "learner/objectives/dual_behavior_objective.h"
#include "learner/objectives/gaussian_divergence.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using testing::ElementsAre;
using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

constexpr int kStates = 6, kDimensions = 2, kObservation = 3, kDraws = 3;
constexpr double kAlpha = 1.7, kEntropyWeight = 0.2;

Matrix Normal(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

// D by a plain loop: the mean over `actions` [dimensions x n], weighted.
double PlainDistance(const Matrix& output, const Matrix& actions, const Vector& weights) {
  double sum = 0;
  for (int j = 0; j < actions.cols(); ++j) {
    double distance = 0;
    for (int d = 0; d < actions.rows(); ++d) {
      distance += std::pow(std::tanh(output(d, j)) - actions(d, j), 2) / static_cast<double>(actions.rows());
    }
    sum += weights[j] * distance;
  }
  return weights.sum() == 0 ? 0 : sum / weights.sum();
}

TEST(ActionWeights, AreThoseOfTheirDefinition) {
  Vector advantages(5), plus, minus;
  advantages << -2, -0.5, 0, 0.5, 2;
  WeighActions<double>({}, advantages, &plus, &minus);
  EXPECT_THAT(plus, ElementsAre(1, 1, 1, 1, 1));
  EXPECT_THAT(minus, ElementsAre(1, 1, 1, 0, 0));
  WeighActions<double>({.kind = DbrConfig::MARGIN, .plus_margin = 0.5, .minus_margin = 1}, advantages, &plus,
                       &minus);
  EXPECT_THAT(plus, ElementsAre(0, 0, 0, 1, 1));
  EXPECT_THAT(minus, ElementsAre(1, 0, 0, 0, 0));
  WeighActions<double>({.kind = DbrConfig::EXPONENTIAL, .temperature = 0.5, .max_weight = 3}, advantages,
                       &plus, &minus);
  const double deviation = std::sqrt(8.5 / 5);
  for (int j = 0; j < 5; ++j) {
    EXPECT_NEAR(plus[j], std::min(3.0, std::exp(advantages[j] / (0.5 * deviation))), 1e-12) << j;
  }
  advantages.setConstant(0.3);
  WeighActions<double>({.kind = DbrConfig::EXPONENTIAL}, advantages, &plus, &minus);
  EXPECT_THAT(plus, ElementsAre(1, 1, 1, 1, 1)) << "no advantage stands out";
}

TEST(ActionWeights, ANanGoesOn) {
  for (const auto kind : {DbrConfig::ALL, DbrConfig::MARGIN, DbrConfig::EXPONENTIAL}) {
    Vector advantages = Vector::Zero(3), plus, minus;
    advantages[1] = std::numeric_limits<double>::quiet_NaN();
    WeighActions<double>({.kind = kind}, advantages, &plus, &minus);
    EXPECT_TRUE(std::isnan(plus[1]) && std::isnan(minus[1])) << DbrConfig::ActionWeights_Name(kind);
  }
}

TEST(ActionDistance, WithoutAnyWeightThereIsNone) {
  Rng rng(3);
  GaussianHead<double> pi;
  pi.Split(Normal(2 * kDimensions, kStates, rng), kPolicyLogStd);
  GaussianDivergence<double> distance;
  distance.ComputeToActions(pi, Normal(kDimensions, kStates, rng).array().tanh());
  distance.WeightBy(Vector::Zero(kStates));
  EXPECT_TRUE(distance.value().isZero(0) && distance.gradient().mean.isZero(0));
}

using Case = std::tuple<DbrConfig::Constraint, DbrConfig::ActionWeights, bool>;  // the last: repel_negative

class ActionLoss : public testing::TestWithParam<Case> {
 protected:
  ActionLoss() {
    options_ = {.constraint = std::get<0>(GetParam()),
                .divergence = DbrConfig::ACTIONS,
                .epsilon = std::get<0>(GetParam()) == DbrConfig::DYNAMIC_MIN ? 50 : 1e-4,
                .repel_negative = std::get<2>(GetParam()),
                .entropy_weight = kEntropyWeight,
                .actions = {.kind = std::get<1>(GetParam()), .temperature = 0.7, .max_weight = 2}};
  }

  PolicyLoss<double> Loss(const Matrix& output, Matrix* gradient) {
    GaussianHead<double> pi;
    pi.Split(output, kPolicyLogStd);
    return objective_.Compute(options_, {pi, unused_, unused_}, observations_, {actions_, values_},
                              {noise_, {}, {}, {}}, kAlpha, &critics_, gradient);
  }

  Rng rng_{35};
  PairRunner runner_{1};
  CriticEnsemble<double> critics_{MlpShape(kObservation + kDimensions, {6, 6}, 1),
                                  {.learning_rate = 1e-3, .with_target = true},
                                  rng_,
                                  &runner_};
  const Matrix observations_ = Normal(kObservation, kStates, rng_);
  const Matrix actions_ = Normal(kDimensions, kStates, rng_).array().tanh();
  const Vector values_ = Normal(kStates, 1, rng_);
  const Matrix noise_ = Normal(kDimensions, kDraws* kStates, rng_);
  const Matrix output_ = 0.5 * Normal(2 * kDimensions, kStates, rng_);
  const GaussianHead<double> unused_;
  DualBehaviorObjective<double> objective_;
  PolicyLossOptions options_;
};

// The weights, and with them everything that depends on the advantages, are constants.
TEST_P(ActionLoss, GradientAgreesWithDifferences) {
  Matrix gradient, unused;
  const PolicyLoss<double> at = Loss(output_, &gradient);
  Vector value(kStates), plus, minus;
  objective_.StateValue(critics_, &value);
  WeighActions<double>(options_.actions, values_ - value, &plus, &minus);
  ASSERT_GT(minus.sum(), 0);
  EXPECT_NEAR(at.divergence_plus, PlainDistance(output_, actions_, plus), 1e-12);
  EXPECT_NEAR(at.divergence_minus, PlainDistance(output_, actions_, minus), 1e-12);
  const bool moved_by_minus = IsMovedByMinus(options_.constraint);
  EXPECT_NEAR(at.threshold, moved_by_minus ? at.divergence_minus : options_.epsilon, 1e-12);
  const auto objective = [&](const Matrix& output) {
    const PolicyLoss<double> moved = Loss(output, &unused);
    const double threshold =
        moved_by_minus && options_.repel_negative ? PlainDistance(output, actions_, minus) : at.threshold;
    return -(moved.value + kEntropyWeight * moved.entropy) +
           kAlpha * (PlainDistance(output, actions_, plus) - threshold);
  };
  EXPECT_NEAR(at.loss, objective(output_), 1e-12);
  ExpectIsGradient(gradient, objective, output_);
}

// max_repulsion limits the distance of each transition, whatever it weighs.
TEST_P(ActionLoss, TheRepulsionHasItsLimit) {
  Matrix gradient;
  options_.max_repulsion = 0.3;
  const PolicyLoss<double> at = Loss(output_, &gradient);
  if (!IsMovedByMinus(options_.constraint)) return;
  Vector value(kStates), plus, minus;
  objective_.StateValue(critics_, &value);
  WeighActions<double>(options_.actions, values_ - value, &plus, &minus);
  double sum = 0, limited = 0;
  for (int j = 0; j < kStates; ++j) {
    const double distance = PlainDistance(output_.col(j), actions_.col(j), Vector::Ones(1));
    sum += minus[j] * distance;
    limited += minus[j] * std::min(distance, 0.3);
  }
  ASSERT_LT(limited, sum) << "else the limit has no part in this test";
  EXPECT_NEAR(at.divergence_minus, sum / minus.sum(), 1e-12) << "the limit is the threshold's alone";
  EXPECT_NEAR(at.threshold, (options_.repel_negative ? limited : sum) / minus.sum(), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(
    Grid, ActionLoss,
    testing::Combine(testing::Values(DbrConfig::DYNAMIC_MAX, DbrConfig::DYNAMIC_MIN, DbrConfig::FIXED),
                     testing::Values(DbrConfig::ALL, DbrConfig::MARGIN, DbrConfig::EXPONENTIAL),
                     testing::Bool()));

}  // namespace
}  // namespace dbr
