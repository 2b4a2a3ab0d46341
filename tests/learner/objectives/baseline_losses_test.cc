// Tests the losses of BRAC, TD3 with its kin, AWAC, IQL and Cal-QL: every gradient against central
// differences in double.
#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "learner/objectives/advantage_weights.h"
#include "learner/objectives/behavior_kl_objective.h"
#include "learner/objectives/conservative_regression.h"
#include "learner/objectives/deterministic_policy.h"
#include "learner/objectives/expectile.h"
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
  double Loss(const Matrix& mean, Matrix* gradient, const DeterministicPolicyTerms& terms = {}) {
    Matrix output = Matrix::Constant(2 * kDimensions, kStates, kPolicyLogStd.min);
    output.topRows(kDimensions) = mean;
    const GaussianHead<double> pi = HeadOf(output, kPolicyLogStd);
    const double loss = objective_.Evaluate(terms, pi, batch_, &critics_);
    if (gradient != nullptr) objective_.Gradient(pi, &critics_, gradient);
    return loss;
  }

  static BasicBatch<double> BatchOf(const Matrix& observations, const Matrix& actions) {
    BasicBatch<double> batch;
    batch.observations = observations;
    batch.actions = actions;
    return batch;
  }

  const BasicBatch<double> batch_ =
      BatchOf(observations_, Normal(kDimensions, kStates, rng_).array().tanh().matrix());
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

TEST_F(DeterministicPolicyTest, ThePullToTheDataHasItsGradientToo) {
  const DeterministicPolicyTerms terms{.normalize_q = true, .q_weight = 2.5, .penalty = 0.7};
  const Matrix mean = output_.topRows(kDimensions);
  Matrix gradient;
  const double loss = Loss(mean, &gradient, terms);
  const double scale = critics_.value1().cwiseAbs().mean();
  const double distance = (mean.array().tanh().matrix() - batch_.actions).colwise().squaredNorm().mean();
  EXPECT_NEAR(loss, -2.5 * critics_.value1().mean() / scale + 0.7 * distance, 1e-12);
  EXPECT_NEAR(objective_.distance(), distance, 1e-12);
  // The scale is a constant of the gradient: as a weight of its own it gives the same.
  Matrix same;
  const DeterministicPolicyTerms weighted{.q_weight = 2.5 / scale, .penalty = 0.7};
  Loss(mean, &same, weighted);
  ExpectNear(gradient, same, 1e-12);
  ExpectIsGradient(
      same.topRows(kDimensions), [&](const Matrix& at) { return Loss(at, nullptr, weighted); }, mean);
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

TEST(ExpectileErrorTest, WeighsTheTwoSidesAndHasItsGradient) {
  Rng rng(5);
  const Matrix v = Normal(1, 6, rng);
  const Vector q = Normal(6, 1, rng);
  Matrix gradient, unused;
  const double loss = ExpectileError<double>(v, q, 0.8, &gradient);
  double sum = 0;
  for (int j = 0; j < 6; ++j) sum += (q[j] > v(0, j) ? 0.8 : 0.2) * std::pow(q[j] - v(0, j), 2);
  EXPECT_NEAR(loss, sum / 6, 1e-12);
  ExpectIsGradient(
      gradient, [&](const Matrix& at) { return ExpectileError<double>(at, q, 0.8, &unused); }, v);
}

class ConservativeLossTest : public testing::Test {
 protected:
  static constexpr int kCount = 3;

  ConservativeLossTest() {
    draws_.actions = Normal(kDimensions, kCount * kStates, rng_);
    draws_.log_prob = Normal(kCount * kStates, 1, rng_);
    draws_.unbounded = kStates;
  }
  double Loss(const Matrix& q, bool calibrated, Matrix* gradient) {
    return ConservativeLoss<double>(q, y_, floor_, draws_, {.weight = 1.7, .calibrated = calibrated},
                                    gradient);
  }

  Rng rng_{8};
  ConservativeDraws<double> draws_;
  const Matrix q_ = Normal(1, (1 + kCount) * kStates, rng_);
  const Vector y_ = Normal(kStates, 1, rng_);
  const Vector floor_ = Normal(kStates, 1, rng_);
};

TEST_F(ConservativeLossTest, GradientMatchesDifferencesWithAndWithoutTheFloor) {
  for (const bool calibrated : {true, false}) {
    Matrix gradient, unused;
    Loss(q_, calibrated, &gradient);
    ExpectIsGradient(
        gradient, [&](const Matrix& at) { return Loss(at, calibrated, &unused); }, q_);
  }
}

TEST_F(ConservativeLossTest, NoDrawOfAPolicyIsPushedBelowTheFloor) {
  Matrix gradient;
  Loss(q_, true, &gradient);
  int held = 0;
  for (int k = 0; k < kCount; ++k) {
    for (int j = 0; j < kStates; ++j) {
      const int column = kStates + k * kStates + j;
      const bool is_held = k > 0 && q_(0, column) < floor_[j];
      EXPECT_EQ(gradient(0, column) == 0, is_held) << "draw " << k << " of state " << j;
      held += is_held;
    }
  }
  EXPECT_GT(held, 0);
}

TEST_F(ConservativeLossTest, OneDrawAtEachStateIsTheDifferenceOfTheTwoValues) {
  draws_.actions.conservativeResize(kDimensions, kStates);
  draws_.log_prob = Vector::Zero(kStates);
  const Matrix q = q_.leftCols(2 * kStates);
  Matrix gradient;
  const Matrix data = q.leftCols(kStates);
  const double expected = (data.row(0).transpose() - y_).squaredNorm() / kStates +
                          1.7 * (q.rightCols(kStates).mean() - data.mean());
  EXPECT_NEAR(Loss(q, false, &gradient), expected, 1e-12);
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
