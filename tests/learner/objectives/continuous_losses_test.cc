// Tests the losses over continuous actions: every gradient against central differences in double, also
// through the critics and the draws.
#include "learner/objectives/continuous_losses.h"

#include <gtest/gtest.h>

#include "core/rng.h"
#include "learner/objectives/bear_objective.h"
#include "learner/objectives/dual_behavior_objective.h"
#include "learner/objectives/soft_policy_objective.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

constexpr int kObservation = 3, kDimensions = 2, kStates = 5, kDraws = 4, kDivergenceSamples = 3;
constexpr double kAlpha = 1.7;

Matrix Normal(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

TEST(SquaredErrorTest, IsTheMeanAndItsGradient) {
  Rng rng(1);
  const Matrix q = Normal(1, 6, rng);
  const Vector y = Normal(6, 1, rng);
  Matrix gradient, unused;
  EXPECT_NEAR(SquaredError<double>(q, y, &gradient), (q.transpose() - y).squaredNorm() / 6, 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& at) { return SquaredError<double>(at, y, &unused); }, q);
}

TEST(GreatestTargetValueTest, TakesTheGreatestOfEachStatesDraws) {
  Matrix q1(1, 4), q2(1, 4);
  q1 << 1, 5, 3, 0;  // draws of states 0, 1, 0, 1
  q2 << 2, 1, 3, 4;
  Vector value(2);
  GreatestTargetValue<double>(q1, q2, 0.75, &value);
  EXPECT_DOUBLE_EQ(value[0], 3);
  EXPECT_DOUBLE_EQ(value[1], 0.75 * 1 + 0.25 * 5);
}

// Three draws of one state; a NaN is in one draw of one critic.
class NaNOfACriticsDraw : public testing::TestWithParam<std::tuple<int, int>> {
 protected:
  NaNOfACriticsDraw() {
    const auto [critic, draw] = GetParam();
    q1_ << 1, 3, 2;
    q2_ << 2, 1, 4;
    (critic == 1 ? q1_ : q2_)(0, draw) = NAN;
  }

  Matrix q1_{1, 3}, q2_{1, 3};
};

TEST_P(NaNOfACriticsDraw, ReachesTheTargetValue) {
  for (const double min_weight : {0.0, 0.75, 1.0}) {
    Vector value(1);
    GreatestTargetValue<double>(q1_, q2_, min_weight, &value);
    EXPECT_TRUE(std::isnan(value[0])) << min_weight;
  }
}

TEST_P(NaNOfACriticsDraw, ReachesTheMeanOfTheSmaller) {
  Vector value(1);
  MeanOfSmaller<double>(q1_, q2_, &value);
  EXPECT_TRUE(std::isnan(value[0]));
}

TEST_P(NaNOfACriticsDraw, ReachesTheLossOfThePolicy) {
  for (const bool normalize : {false, true}) {
    QTerm<double> term;
    SmallerMeanQTerm<double>({.use_q = true, .normalize = normalize}, q1_, q2_, 1, &term);
    EXPECT_TRUE(std::isnan(term.value) && std::isnan(term.loss)) << normalize;
  }
}

INSTANTIATE_TEST_SUITE_P(Each, NaNOfACriticsDraw,
                         testing::Combine(testing::Values(1, 2), testing::Values(0, 1, 2)),
                         [](const auto& info) {
                           return "Critic" + std::to_string(std::get<0>(info.param)) + "Draw" +
                                  std::to_string(std::get<1>(info.param));
                         });

TEST(MeanOfSmallerTest, AveragesTheSmallerTwinOfEachDraw) {
  Matrix q1(1, 4), q2(1, 4);
  q1 << 1, 5, 3, 0;
  q2 << 2, 1, 3, 4;
  Vector value(2);
  MeanOfSmaller<double>(q1, q2, &value);
  EXPECT_DOUBLE_EQ(value[0], 2);
  EXPECT_DOUBLE_EQ(value[1], 0.5);
}

TEST(SmallerMeanQTermTest, HasItsGradientsAndLeavesTheScaleConstant) {
  Rng rng(2);
  const Matrix q1 = Normal(1, kDraws * kStates, rng), q2 = Normal(1, kDraws * kStates, rng);
  for (const bool normalize : {false, true}) {
    QTerm<double> term, moved;
    SmallerMeanQTerm<double>({.use_q = true, .normalize = normalize}, q1, q2, kStates, &term);
    const double scale = -term.value / term.loss;
    const auto objective = [&](const Matrix& first, const Matrix& second) {
      SmallerMeanQTerm<double>({}, first, second, kStates, &moved);
      return moved.loss / scale;
    };
    ExpectIsGradient(
        term.d_q1, [&](const Matrix& at) { return objective(at, q2); }, q1);
    ExpectIsGradient(
        term.d_q2, [&](const Matrix& at) { return objective(q1, at); }, q2);
    if (!normalize) {
      EXPECT_DOUBLE_EQ(scale, 1);
    }
  }
}

TEST(SoftPolicyObjectiveTest, GradientMatchesDifferences) {
  Rng rng(8);
  PairRunner runner(1);
  CriticEnsemble<double> critics(MlpShape(kObservation + kDimensions, {6, 6}, 1),
                                 {.learning_rate = 1e-3, .with_target = true}, rng, &runner);
  const Matrix observations = Normal(kObservation, kStates, rng), noise = Normal(kDimensions, kStates, rng);
  const Matrix output = 0.5 * Normal(2 * kDimensions, kStates, rng);
  SoftPolicyObjective<double> objective;
  const auto loss = [&](const Matrix& at, Matrix* gradient) {
    GaussianHead<double> pi;
    pi.Split(at, kPolicyLogStd);
    return objective.Compute(pi, observations, noise, 0.3, &critics, gradient);
  };
  Matrix gradient, unused;
  const SoftPolicyLoss<double> at_output = loss(output, &gradient);
  EXPECT_NEAR(at_output.loss, -at_output.value - 0.3 * at_output.entropy, 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& at) { return loss(at, &unused).loss; }, output);
}

class BearObjectiveTest : public testing::TestWithParam<DbrConfig::Divergence> {};

TEST_P(BearObjectiveTest, GradientMatchesDifferences) {
  Rng rng(6);
  PairRunner runner(1);
  CriticEnsemble<double> critics(MlpShape(kObservation + kDimensions, {6, 6}, 1),
                                 {.learning_rate = 1e-3, .with_target = true}, rng, &runner);
  const Matrix observations = Normal(kObservation, kStates, rng);
  const Matrix actions = Normal(kDimensions, kDraws * kStates, rng);
  const Matrix noise = Normal(kDimensions, kDivergenceSamples * kStates, rng);
  const Matrix behavior = Normal(kDimensions, kDivergenceSamples * kStates, rng);
  const Matrix output = 0.5 * Normal(2 * kDimensions, kStates, rng);
  PolicyLossOptions options{.divergence = GetParam(), .epsilon = 0.02, .mmd_sigma = 1.5};
  BearObjective<double> objective;
  const auto loss = [&](const Matrix& at, Matrix* gradient) {
    GaussianHead<double> pi;
    pi.Split(at, kPolicyLogStd);
    return objective.Compute(options, {{pi, observations, actions}, noise, behavior}, kAlpha, &critics,
                             gradient);
  };
  for (const bool use_q : {true, false}) {
    options.use_q = use_q;
    Matrix gradient, unused;
    const ConstrainedLoss<double> at = loss(output, &gradient);
    EXPECT_EQ(at.threshold, 0.02);
    EXPECT_NEAR(at.loss, (use_q ? -at.value : 0) + kAlpha * (at.divergence - 0.02), 1e-12);
    ExpectIsGradient(
        gradient, [&](const Matrix& moved) { return loss(moved, &unused).loss; }, output);
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, BearObjectiveTest,
                         testing::Values(DbrConfig::MMD_LAPLACIAN, DbrConfig::MMD_GAUSSIAN));

struct Case {
  DbrConfig::Constraint constraint;
  DbrConfig::Divergence divergence;
  bool repel_negative;
  double entropy_weight;
  double epsilon;
};

class ObjectiveTest : public testing::TestWithParam<Case> {
 protected:
  ObjectiveTest()
      : critics_(MlpShape(kObservation + kDimensions, {6, 6}, 1),
                 {.learning_rate = 1e-3, .with_target = true}, rng_, &runner_) {
    plus_.Split(0.5 * Normal(2 * kDimensions, kStates, rng_), kBehaviorLogStd);
    minus_.Split(0.5 * Normal(2 * kDimensions, kStates, rng_), kBehaviorLogStd);
    noise_ = {.actions = Normal(kDimensions, kDraws * kStates, rng_),
              .pi = Normal(kDimensions, kDivergenceSamples * kStates, rng_),
              .plus = Normal(kDimensions, kDivergenceSamples * kStates, rng_),
              .minus = Normal(kDimensions, kDivergenceSamples * kStates, rng_)};
    options_ = {.constraint = GetParam().constraint,
                .divergence = GetParam().divergence,
                .epsilon = GetParam().epsilon,
                .mmd_sigma = 1.5,
                .repel_negative = GetParam().repel_negative,
                .entropy_weight = GetParam().entropy_weight};
  }

  PolicyLoss<double> Loss(const Matrix& output, Matrix* d_output) {
    GaussianHead<double> pi;
    pi.Split(output, kPolicyLogStd);
    const Matrix no_actions;
    return objective_.Compute(options_, {pi, plus_, minus_}, observations_, {no_actions, VectorX<double>()},
                              noise_, kAlpha, &critics_, d_output);
  }
  // Returns the loss with a constant threshold, unless repel_negative is set.
  double Objective(const Matrix& output, const PolicyLoss<double>& at) {
    Matrix unused;
    const PolicyLoss<double> moved = Loss(output, &unused);
    const bool repels = options_.repel_negative && at.threshold != options_.epsilon;
    if (options_.constraint == DbrConfig::NONE) {
      return -moved.value - options_.entropy_weight * moved.entropy;
    }
    return -moved.value - options_.entropy_weight * moved.entropy +
           kAlpha * (moved.divergence_plus - (repels ? moved.divergence_minus : at.threshold));
  }

  Rng rng_{5};
  PairRunner runner_{1};
  CriticEnsemble<double> critics_;
  DualBehaviorObjective<double> objective_;
  GaussianHead<double> plus_, minus_;
  ObjectiveNoise<double> noise_;
  PolicyLossOptions options_;
  const Matrix observations_ = Normal(kObservation, kStates, rng_);
  const Matrix output_ = 0.5 * Normal(2 * kDimensions, kStates, rng_);
};

TEST_P(ObjectiveTest, GradientMatchesDifferences) {
  Matrix gradient;
  const PolicyLoss<double> loss = Loss(output_, &gradient);
  EXPECT_NEAR(loss.loss, Objective(output_, loss), 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& at) { return Objective(at, loss); }, output_);
}

TEST_P(ObjectiveTest, AClippedLogStdHasTheGradientThatLeadsBackAlone) {
  Matrix output = output_;
  Matrix at_limit, beyond;
  output.row(kDimensions).setConstant(kPolicyLogStd.max);
  Loss(output, &at_limit);
  output.row(kDimensions).setConstant(kPolicyLogStd.max + 0.5);
  Loss(output, &beyond);
  // A step goes against the gradient.
  EXPECT_EQ(beyond.row(kDimensions), at_limit.row(kDimensions).cwiseMax(0));
  EXPECT_FALSE(at_limit.row(kDimensions).isZero(0));
}

INSTANTIATE_TEST_SUITE_P(Variants, ObjectiveTest,
                         testing::Values(Case{DbrConfig::DYNAMIC_MAX, DbrConfig::KL, false, 0, 1e-3},
                                         Case{DbrConfig::DYNAMIC_MAX, DbrConfig::KL, true, 0.2, 1e-3},
                                         Case{DbrConfig::DYNAMIC_MIN, DbrConfig::MMD_EXACT, true, 0, 10},
                                         Case{DbrConfig::DYNAMIC_MIN, DbrConfig::MMD_EXACT, false, 0.1, 0.05},
                                         Case{DbrConfig::FIXED, DbrConfig::MMD_LAPLACIAN, false, 0, 0.05},
                                         Case{DbrConfig::DYNAMIC_MAX, DbrConfig::MMD_LAPLACIAN, true, 0,
                                              1e-3},
                                         Case{DbrConfig::FIXED, DbrConfig::MMD_GAUSSIAN, false, 0.3, 0.05},
                                         Case{DbrConfig::NONE, DbrConfig::KL, true, 0.3, 0.05}));

}  // namespace
}  // namespace dbr
