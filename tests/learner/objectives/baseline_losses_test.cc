// Tests the losses of BRAC, TD3 and AWAC: every gradient against central differences in double.
#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "learner/objectives/advantage_weights.h"
#include "learner/objectives/behavior_kl_objective.h"
#include "learner/objectives/deterministic_policy.h"
#include "learner/objectives/gaussian_likelihood.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

constexpr int kObservation = 3, kDimensions = 2, kStates = 5, kDraws = 4;

Matrix Normal(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

GaussianHead<double> HeadOf(const Matrix& output, const LogStdLimits& limits) {
  GaussianHead<double> head;
  head.Split(output, limits);
  return head;
}

class PolicyLossTest : public testing::Test {
 protected:
  Rng rng_{31};
  PairRunner runner_{1};
  CriticEnsemble<double> critics_{MlpShape(kObservation + kDimensions, {6, 6}, 1),
                                  {.learning_rate = 1e-3, .with_target = true},
                                  rng_,
                                  &runner_};
  const Matrix observations_ = Normal(kObservation, kStates, rng_);
  const Matrix output_ = 0.5 * Normal(2 * kDimensions, kStates, rng_);
};

class BehaviorKlTest : public PolicyLossTest {
 protected:
  BehaviorKlLoss<double> Loss(const Matrix& output, bool use_q, Matrix* gradient) {
    return objective_.Compute({HeadOf(output, kPolicyLogStd), beta_, noise_}, observations_, kAlpha, use_q,
                              &critics_, gradient);
  }

  static constexpr double kAlpha = 1.3;
  BehaviorKlObjective<double> objective_;
  const GaussianHead<double> beta_ = HeadOf(0.5 * Normal(2 * kDimensions, kStates, rng_), kBehaviorLogStd);
  const Matrix noise_ = Normal(kDimensions, kDraws* kStates, rng_);
};

TEST_F(BehaviorKlTest, GradientMatchesDifferencesWithAndWithoutTheQTerm) {
  for (const bool use_q : {true, false}) {
    Matrix gradient, unused;
    const BehaviorKlLoss<double> loss = Loss(output_, use_q, &gradient);
    EXPECT_NEAR(loss.loss, kAlpha * loss.divergence - (use_q ? loss.value : 0), 1e-12);
    ExpectIsGradient(
        gradient, [&](const Matrix& at) { return Loss(at, use_q, &unused).loss; }, output_);
  }
}

TEST_F(BehaviorKlTest, APolicyEqualToTheBehaviourHasNoDivergence) {
  Matrix same(2 * kDimensions, kStates), gradient;
  same << beta_.mean(), beta_.log_std();
  EXPECT_NEAR(Loss(same, true, &gradient).divergence, 0, 1e-12);
}

TEST_F(BehaviorKlTest, AClippedLogStdHasTheGradientThatLeadsBackAlone) {
  Matrix output = output_, at_limit, beyond;
  output.row(kDimensions).setConstant(kPolicyLogStd.max);
  Loss(output, true, &at_limit);
  output.row(kDimensions).setConstant(kPolicyLogStd.max + 0.5);
  Loss(output, true, &beyond);
  EXPECT_EQ(beyond.row(kDimensions), at_limit.row(kDimensions).cwiseMax(0));
  EXPECT_FALSE(at_limit.row(kDimensions).isZero(0));
}

class DeterministicPolicyTest : public PolicyLossTest {
 protected:
  // Returns the loss with the log-stds fixed as in TD3.
  double Loss(const Matrix& mean, Matrix* gradient) {
    Matrix output = Matrix::Constant(2 * kDimensions, kStates, kPolicyLogStd.min);
    output.topRows(kDimensions) = mean;
    const GaussianHead<double> pi = HeadOf(output, kPolicyLogStd);
    const double loss = objective_.Evaluate(pi, observations_, &critics_);
    if (gradient != nullptr) objective_.Gradient(pi, &critics_, gradient);
    return loss;
  }

  DeterministicPolicyObjective<double> objective_;
};

TEST_F(DeterministicPolicyTest, GradientMatchesDifferencesAndLeavesTheLogStdsAlone) {
  const Matrix mean = output_.topRows(kDimensions);
  Matrix gradient;
  const double loss = Loss(mean, &gradient);
  EXPECT_DOUBLE_EQ(loss, -critics_.value1().mean());
  EXPECT_EQ(gradient.bottomRows(kDimensions).cwiseAbs().maxCoeff(), 0);
  ExpectIsGradient(
      gradient.topRows(kDimensions), [&](const Matrix& at) { return Loss(at, nullptr); }, mean);
}

TEST_F(DeterministicPolicyTest, PinningGivesEveryStateTheLowestLogStd) {
  const MlpShape shape(kObservation, {6}, 2 * kDimensions);
  Vector parameters = InitialParameters<double>(shape, rng_);
  MlpActivations<double> activations;
  const Matrix before = MlpForward<double>(shape, parameters.data(), observations_, &activations);
  PinLogStd(shape, &parameters);
  const Matrix& after = MlpForward<double>(shape, parameters.data(), observations_, &activations);
  EXPECT_EQ(after.topRows(kDimensions), before.topRows(kDimensions));
  EXPECT_EQ(after.bottomRows(kDimensions), Matrix::Constant(kDimensions, kStates, kPolicyLogStd.min));
}

TEST(SmoothedActionsTest, ClipsTheNoiseAndTheAction) {
  Matrix mean(1, 4), noise(1, 4), actions, expected(1, 4);
  mean << 0, 0, std::atanh(0.9), std::atanh(-0.5);
  noise << 1, -10, 4, 0;
  SmoothedActions<double>(mean, noise, {.deviation = 0.2, .limit = 0.5}, &actions);
  expected << 0.2, -0.5, 1, -0.5;
  ExpectNear(actions, expected, 1e-12);
}

TEST(AdvantageWeightsTest, AreExponentialUpToTheLimit) {
  Vector advantages(4), weights, expected(4);
  advantages << 0, -2, 3, 5000;
  AdvantageWeights<double>(advantages, {.temperature = 2, .max_weight = 4}, &weights);
  expected << 1, std::exp(-1), 4, 4;
  ExpectNear(weights, expected, 1e-12);
}

TEST(AdvantageWeightsTest, DoNotLoseANaN) {
  Vector weights;
  AdvantageWeights<double>(Vector::Constant(1, NAN), {}, &weights);
  EXPECT_TRUE(std::isnan(weights[0]));
}

// Checks AWAC's whole policy loss through the network's parameters. With a learning rate of 0, Fit changes
// nothing.
TEST(WeightedLikelihoodTest, GradientMatchesDifferencesWithTheWeightsConstant) {
  Rng rng(32);
  TrainedNetwork<double> network(MlpShape(kObservation, {6}, 2 * kDimensions), TrainingOptions{}, rng);
  BasicBatch<double> batch;
  batch.Resize({kObservation, kDimensions, 0}, kStates, /*with_keys=*/false);
  batch.observations = Normal(kObservation, kStates, rng);
  batch.actions = Normal(kDimensions, kStates, rng).array().tanh().matrix();
  const Vector weights = Normal(kStates, 1, rng).array().exp().matrix();
  GaussianLikelihood<double> likelihood(kBehaviorLogStd);
  const auto loss = [&](const Matrix& parameters) {
    network.SetParameters(parameters);
    likelihood.Fit(batch, &weights, &network);
    return likelihood.loss();
  };
  const Matrix start = network.parameters();
  const double at_start = loss(start);
  EXPECT_NEAR(at_start, -weights.dot(likelihood.log_prob()) / kStates, 1e-12);
  const Matrix gradient = network.gradient();
  ExpectIsGradient(gradient, loss, start);
}

}  // namespace
}  // namespace dbr
