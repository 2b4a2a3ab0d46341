// Tests the losses over discrete actions: every gradient against central differences in double, also through
// the networks.
#include "learner/objectives/discrete_losses.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

constexpr int kActions = 4, kStates = 6, kInputs = 3;

Matrix Uniform(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return 2 * rng.Uniform() - 1; });
}

Categorical<double> Softmax(const Matrix& logits, const Matrix& masks) {
  Categorical<double> p;
  MaskedSoftmax<double>(logits, masks, &p);
  return p;
}

struct Case {
  DbrConfig::Constraint constraint;
  DbrConfig::Divergence divergence;
  bool repel_negative;
  double entropy_weight;
  double epsilon;
};

class PolicyLossTest : public testing::TestWithParam<Case> {
 protected:
  PolicyLossTest() {
    masks_(3, 1) = masks_(0, 4) = 0;
    options_.constraint = GetParam().constraint;
    options_.divergence = GetParam().divergence;
    options_.repel_negative = GetParam().repel_negative;
    options_.entropy_weight = GetParam().entropy_weight;
    options_.epsilon = GetParam().epsilon;
  }

  PolicyLoss<double> Loss(const Matrix& logits, Matrix* gradient) {
    PolicyLossWorkspace<double> workspace;
    return DualBehaviorPolicyLoss<double>(options_, Softmax(logits, masks_), q1_, q2_, plus_, minus_, kAlpha,
                                          &workspace, gradient);
  }
  // Returns the loss. What the definition holds constant is constant here: the threshold, unless
  // repel_negative is set.
  double Objective(const Matrix& logits, const PolicyLoss<double>& at) {
    Matrix unused;
    const PolicyLoss<double> moved = Loss(logits, &unused);
    const bool repels = options_.repel_negative && at.threshold != options_.epsilon;
    const bool constrained = options_.constraint != DbrConfig::NONE;
    const double threshold = repels ? moved.divergence_minus : at.threshold;
    return -moved.value - options_.entropy_weight * moved.entropy +
           (constrained ? kAlpha * (moved.divergence_plus - threshold) : 0);
  }

  static constexpr double kAlpha = 0.7;
  Rng rng_{11};
  PolicyLossOptions options_;
  Matrix masks_ = Matrix::Ones(kActions, kStates);
  Matrix q1_ = Uniform(kActions, kStates, rng_), q2_ = Uniform(kActions, kStates, rng_);
  Categorical<double> plus_ = Softmax(Uniform(kActions, kStates, rng_), Matrix::Ones(kActions, kStates));
  Categorical<double> minus_ = Softmax(Uniform(kActions, kStates, rng_), Matrix::Ones(kActions, kStates));
};

TEST_P(PolicyLossTest, GradientAgreesWithDifferences) {
  const Matrix logits = Uniform(kActions, kStates, rng_);
  Matrix gradient;
  const PolicyLoss<double> at = Loss(logits, &gradient);
  EXPECT_EQ(gradient(3, 1), 0);
  EXPECT_NEAR(at.loss, Objective(logits, at), 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& z) { return Objective(z, at); }, logits);
}

TEST_P(PolicyLossTest, GradientThroughTheNetworkAgreesWithDifferences) {
  const MlpShape shape(kInputs, {5, 6}, kActions);
  const Vector parameters = InitialParameters<double>(shape, rng_);
  const Matrix x = Uniform(kInputs, kStates, rng_);
  MlpActivations<double> activations;
  Matrix d_logits;
  const PolicyLoss<double> at =
      Loss(MlpForward<double>(shape, parameters.data(), x, &activations), &d_logits);
  Vector gradient;
  MlpParameterGradient<double>(parameters.data(), x, d_logits, &activations, &gradient);
  ExpectIsGradient(
      gradient,
      [&](const Matrix& p) {
        MlpActivations<double> scratch;
        return Objective(MlpForward<double>(shape, p.data(), x, &scratch), at);
      },
      parameters);
}

TEST_P(PolicyLossTest, NormalizingDividesTheQTermAlone) {
  options_.normalize_q = false;
  const Matrix logits = Uniform(kActions, kStates, rng_);
  const auto gradient_of_q_term = [&](bool normalize) {
    Matrix with_q, without_q;
    options_.normalize_q = normalize;
    options_.use_q = true;
    Loss(logits, &with_q);
    options_.use_q = false;
    Loss(logits, &without_q);
    return Matrix(with_q - without_q);
  };
  const Matrix plain = gradient_of_q_term(false), normalized = gradient_of_q_term(true);
  Eigen::Index row, col;
  plain.cwiseAbs().maxCoeff(&row, &col);
  const double scale = plain(row, col) / normalized(row, col);
  EXPECT_GT(scale, 0.1);
  EXPECT_LT(scale, 0.9);  // the mean of |Q| for Q in [-1, 1]
  ExpectNear(normalized * scale, plain, 1e-9);
}

TEST_P(PolicyLossTest, WithAFixedThresholdBearsLossIsDbrs) {
  options_.constraint = DbrConfig::FIXED;
  const Matrix logits = Uniform(kActions, kStates, rng_);
  Matrix of_dbr, of_bear;
  const PolicyLoss<double> dbr = Loss(logits, &of_dbr);
  PolicyLossWorkspace<double> workspace;
  const ConstrainedLoss<double> bear = ConstrainedPolicyLoss<double>(
      options_, {Softmax(logits, masks_), q1_, q2_}, {plus_, options_.epsilon, kAlpha}, &workspace, &of_bear);
  EXPECT_EQ(bear.loss, dbr.loss);
  EXPECT_EQ(bear.divergence, dbr.divergence_plus);
  EXPECT_EQ(of_bear, of_dbr);
}

INSTANTIATE_TEST_SUITE_P(Options, PolicyLossTest,
                         testing::Values(Case{DbrConfig::DYNAMIC_MAX, DbrConfig::KL, false, 0.0, 0.05},
                                         Case{DbrConfig::DYNAMIC_MAX, DbrConfig::KL, true, 0.1, 0.05},
                                         Case{DbrConfig::DYNAMIC_MAX, DbrConfig::MMD_EXACT, true, 0.0,
                                              10.0},  // eps is the larger one
                                         Case{DbrConfig::DYNAMIC_MIN, DbrConfig::KL, true, 0.0, 10.0},
                                         Case{DbrConfig::DYNAMIC_MIN, DbrConfig::MMD_EXACT, true, 0.2, 10.0},
                                         Case{DbrConfig::FIXED, DbrConfig::MMD_EXACT, false, 0.0, 0.05},
                                         Case{DbrConfig::FIXED, DbrConfig::KL, true, 0.0, 0.05},
                                         Case{DbrConfig::NONE, DbrConfig::KL, true, 0.2, 0.05}));

TEST(PolicyLoss, ThresholdFollowsTheConstraint) {
  Rng rng(2);
  const Matrix ones = Matrix::Ones(kActions, kStates), q = Uniform(kActions, kStates, rng);
  const auto pi = Softmax(Uniform(kActions, kStates, rng), ones),
             plus = Softmax(Uniform(kActions, kStates, rng), ones),
             minus = Softmax(3 * Uniform(kActions, kStates, rng), ones);
  PolicyLossWorkspace<double> workspace;
  Matrix gradient;
  PolicyLossOptions options;
  const auto threshold = [&](DbrConfig::Constraint constraint, double epsilon) {
    options.constraint = constraint;
    options.epsilon = epsilon;
    return DualBehaviorPolicyLoss<double>(options, pi, q, q, plus, minus, 1.0, &workspace, &gradient);
  };
  const double divergence = threshold(DbrConfig::DYNAMIC_MAX, 0.05).divergence_minus;
  ASSERT_GT(divergence, 0.05);
  EXPECT_EQ(threshold(DbrConfig::FIXED, 0.05).threshold, 0.05);
  EXPECT_EQ(threshold(DbrConfig::DYNAMIC_MAX, 0.05).threshold, divergence);
  EXPECT_EQ(threshold(DbrConfig::DYNAMIC_MAX, 100).threshold, 100);
  EXPECT_EQ(threshold(DbrConfig::DYNAMIC_MIN, 0.05).threshold, 0.05);
  EXPECT_EQ(threshold(DbrConfig::DYNAMIC_MIN, 100).threshold, divergence);
}

TEST(CriticLoss, GradientThroughTheNetworkAgreesWithDifferences) {
  Rng rng(4);
  const MlpShape shape(kInputs, {5, 6}, kActions);
  const Vector parameters = InitialParameters<double>(shape, rng), y = Uniform(kStates, 1, rng);
  const Matrix x = Uniform(kInputs, kStates, rng);
  Matrix actions(1, kStates);
  actions << 0, 1, 2, 3, 2, 1;
  MlpActivations<double> activations;
  Matrix d_q;
  CriticLoss<double>(MlpForward<double>(shape, parameters.data(), x, &activations), actions, y, &d_q);
  Vector gradient;
  MlpParameterGradient<double>(parameters.data(), x, d_q, &activations, &gradient);
  ExpectIsGradient(
      gradient,
      [&](const Matrix& p) {
        MlpActivations<double> scratch;
        Matrix unused;
        return CriticLoss<double>(MlpForward<double>(shape, p.data(), x, &scratch), actions, y, &unused);
      },
      parameters);
}

class SoftPolicyLossTest : public testing::Test {
 protected:
  SoftPolicyLossTest() { masks_(3, 1) = masks_(0, 4) = 0; }

  SoftPolicyLoss<double> Loss(const Matrix& logits, Matrix* gradient) const {
    Vector workspace;
    return DiscreteSoftPolicyLoss<double>(Softmax(logits, masks_), q1_, q2_, kTemperature, &workspace,
                                          gradient);
  }
  double LossAlone(const Matrix& logits) const {
    Matrix unused;
    return Loss(logits, &unused).loss;
  }

  static constexpr double kTemperature = 0.3;
  Rng rng_{12};
  Matrix masks_ = Matrix::Ones(kActions, kStates);
  Matrix q1_ = Uniform(kActions, kStates, rng_), q2_ = Uniform(kActions, kStates, rng_);
};

TEST_F(SoftPolicyLossTest, GradientAgreesWithDifferences) {
  const Matrix logits = Uniform(kActions, kStates, rng_);
  Matrix gradient;
  Loss(logits, &gradient);
  EXPECT_EQ(gradient(3, 1), 0);
  ExpectIsGradient(
      gradient, [&](const Matrix& z) { return LossAlone(z); }, logits);
}

TEST_F(SoftPolicyLossTest, GradientThroughTheNetworkAgreesWithDifferences) {
  const MlpShape shape(kInputs, {5, 6}, kActions);
  const Vector parameters = InitialParameters<double>(shape, rng_);
  const Matrix x = Uniform(kInputs, kStates, rng_);
  MlpActivations<double> activations;
  Matrix d_logits;
  Loss(MlpForward<double>(shape, parameters.data(), x, &activations), &d_logits);
  Vector gradient;
  MlpParameterGradient<double>(parameters.data(), x, d_logits, &activations, &gradient);
  ExpectIsGradient(
      gradient,
      [&](const Matrix& p) {
        MlpActivations<double> scratch;
        return LossAlone(MlpForward<double>(shape, p.data(), x, &scratch));
      },
      parameters);
}

TEST_F(SoftPolicyLossTest, TakesTheSmallerTwinOfEachAction) {
  masks_ = Matrix::Ones(2, 1);
  q1_.resize(2, 1);
  q2_.resize(2, 1);
  q1_ << 1, 4;
  q2_ << 3, 2;
  Matrix gradient;
  const SoftPolicyLoss<double> loss = Loss(Matrix::Zero(2, 1), &gradient);
  EXPECT_DOUBLE_EQ(loss.value, 0.5 * 1 + 0.5 * 2);
  EXPECT_DOUBLE_EQ(loss.entropy, std::log(2));
  EXPECT_DOUBLE_EQ(loss.loss, -1.5 - kTemperature * std::log(2));
}

TEST(GreedyValue, TheJudgeValuesWhatTheChooserFindsTheGreatestLegalAction) {
  Matrix chooser(3, 2), judge(3, 2), masks = Matrix::Ones(3, 2);
  chooser << 1, 1, 2, 2, 1e9, 3;
  judge << 10, 10, 20, 20, 1e9, 30;
  masks(2, 0) = 0;
  Vector value;
  GreedyValue<double>(chooser, judge, masks, &value);
  EXPECT_EQ(value[0], 20);
  EXPECT_EQ(value[1], 30);
  GreedyValue<double>(chooser, judge, Matrix::Zero(3, 2), &value);
  EXPECT_EQ(value, Vector::Zero(2)) << "a state without legal actions has no value";
}

TEST(Advantages, AreMeasuredFromTheValueByTheSmallerTwin) {
  Matrix q1(2, 2), q2(2, 2), actions(1, 2);
  q1 << 1, 4, 2, 5;
  q2 << 3, 2, 0, 7;
  actions << 0, 1;
  Vector value(2);
  value << 0.5, 6;
  std::vector<float> advantages;
  ComputeAdvantages<double>(q1, q2, actions, value, &advantages);
  EXPECT_EQ(advantages, (std::vector<float>{0.5f, -1}));
}

TEST(MeanGreatestEntropy, IsTheLogOfTheNumberOfLegalActions) {
  Matrix masks = Matrix::Ones(4, 3);
  masks.col(1) << 0, 1, 0, 1;
  masks.col(2).setZero();
  EXPECT_DOUBLE_EQ(MeanGreatestEntropy<double>(masks), (std::log(4.0) + std::log(2.0)) / 3);
}

TEST(TargetValue, MixesTheTwinsUnderThePolicy) {
  Matrix logits = Matrix::Zero(2, 1), q1(2, 1), q2(2, 1);
  q1 << 1, 4;
  q2 << 3, 2;
  Vector value;
  ExpectedTargetValue<double>(Softmax(logits, Matrix::Ones(2, 1)), q1, q2, 0.75, &value);
  EXPECT_DOUBLE_EQ(value[0], 0.5 * (0.75 * 1 + 0.25 * 3) + 0.5 * (0.75 * 2 + 0.25 * 4));
  ExpectedTargetValue<double>(Softmax(logits, Matrix::Zero(2, 1)), q1, q2, 0.75, &value);
  EXPECT_EQ(value[0], 0) << "a state without legal actions has no value";
}

// The twins of two states and two actions; one entry of one of them is a NaN.
class NaNOfACritic : public testing::TestWithParam<int> {
 protected:
  NaNOfACritic() {
    q1_ << 1, 4, 2, 5;
    q2_ << 3, 2, 0, 7;
    (GetParam() == 1 ? q1_ : q2_)(0, 0) = NAN;
  }

  Matrix q1_{2, 2}, q2_{2, 2};
  Categorical<double> policy_ = Softmax(Matrix::Zero(2, 2), Matrix::Ones(2, 2));
};

TEST_P(NaNOfACritic, ReachesTheTargetValueOfItsStateAlone) {
  for (const double min_weight : {0.0, 0.75, 1.0}) {
    Vector value;
    ExpectedTargetValue<double>(policy_, q1_, q2_, min_weight, &value);
    EXPECT_TRUE(std::isnan(value[0])) << min_weight;
    EXPECT_TRUE(std::isfinite(value[1])) << min_weight;
  }
}

TEST_P(NaNOfACritic, ReachesTheAdvantageOfItsStateAlone) {
  std::vector<float> advantages;
  ComputeAdvantages<double>(q1_, q2_, Matrix::Zero(1, 2), Vector::Zero(2), &advantages);
  EXPECT_TRUE(std::isnan(advantages[0]));
  EXPECT_EQ(advantages[1], 2);
}

TEST_P(NaNOfACritic, ReachesTheLossesOfThePolicy) {
  Vector entropy;
  Matrix gradient;
  const auto soft = DiscreteSoftPolicyLoss<double>(policy_, q1_, q2_, 0.5, &entropy, &gradient);
  EXPECT_TRUE(std::isnan(soft.value) && std::isnan(soft.loss));
  PolicyLossWorkspace<double> workspace;
  for (const bool normalize : {false, true}) {
    PolicyLossOptions options;
    options.normalize_q = normalize;
    const auto loss =
        ConstrainedPolicyLoss<double>(options, {policy_, q1_, q2_}, {policy_, 0.1, 1}, &workspace, &gradient);
    EXPECT_TRUE(std::isnan(loss.value) && std::isnan(loss.loss)) << normalize;
  }
}

INSTANTIATE_TEST_SUITE_P(Each, NaNOfACritic, testing::Values(1, 2),
                         [](const auto& info) { return info.param == 1 ? "First" : "Second"; });

TEST(GreedyValue, ANaNOfTheChooserOrTheJudgeIsNotPassedOver) {
  for (const int place : {0, 1, 2}) {
    Matrix chooser(3, 1);
    chooser << 1, 3, 2;
    const Matrix judge = chooser, masks = Matrix::Ones(3, 1);
    chooser(place, 0) = NAN;
    Vector value;
    GreedyValue<double>(chooser, judge, masks, &value);
    EXPECT_TRUE(std::isnan(value[0])) << place;
  }
  Matrix chooser(2, 1), judge(2, 1), masks(2, 1);
  chooser << NAN, 1;
  judge << 5, 6;
  masks << 0, 1;
  Vector value;
  GreedyValue<double>(chooser, judge, masks, &value);
  EXPECT_EQ(value[0], 6) << "no one looks at what is illegal";
}

}  // namespace
}  // namespace dbr
