// Tests DBR's ablations: self-imitation, the Munchausen term and the missing constraint each change what they
// should, and nothing else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "learner/algorithms/continuous_dbr.h"
#include "learner/algorithms/discrete_dbr.h"
#include "learner/algorithms/registry.h"
#include "learner/objectives/gaussian_likelihood.h"
#include "learner/objectives/munchausen.h"
#include "learner/objectives/self_imitation.h"
#include "nn/policy_networks.h"
#include "tests/learner/algorithms/batches.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

BasicBatch<double> WithReturns(const std::vector<double>& returns) {
  BasicBatch<double> batch;
  const auto n = static_cast<Eigen::Index>(returns.size());
  batch.Resize({2, 1, 0, 1}, n, /*with_keys=*/false);
  batch.returns = Eigen::Map<const Vector>(returns.data(), n);
  return batch;
}

TEST(SelfImitationTest, WeighsWhatDidBetterThanItsValueByHowMuch) {
  SelfImitation<double> imitation;
  Vector value(4);
  value << 1, 8, 6, 2;
  imitation.Judge(WithReturns({2, 4, 3, 4}), /*reward_scale=*/2, value);
  EXPECT_THAT(imitation.advantage(), testing::ElementsAre(3, 0, 0, 6));
  EXPECT_TRUE(imitation.imitates());
  EXPECT_THAT(imitation.weights(), testing::ElementsAre(3 / 2.25, 0, 0, 6 / 2.25));
  EXPECT_DOUBLE_EQ(imitation.weights().mean(), 1);
}

TEST(SelfImitationTest, ImitatesNothingWhereNothingDidBetter) {
  SelfImitation<double> imitation;
  imitation.Judge(WithReturns({1, 2}), 1, Vector::Constant(2, 2.0));
  EXPECT_FALSE(imitation.imitates());
  EXPECT_TRUE(imitation.weights().isZero(0));
  EXPECT_THAT(imitation.advantage(), testing::ElementsAre(-1, 0));
}

TEST(MunchausenTest, TheLogIsClippedOnBothSides) {
  Vector log_prob(4), bonus;
  log_prob << 0.7, 0, -0.5, -30;
  MunchausenBonus<double>(0.9, log_prob, &bonus);
  EXPECT_THAT(bonus, testing::ElementsAre(0, 0, testing::DoubleEq(-0.45), testing::DoubleEq(-0.9)));
}

// Checks the gradient of the weighted likelihood through the network, read from the network's own gradient.
TEST(GaussianLikelihoodTest, TheWeightedFitHasItsGradient) {
  Rng rng(3);
  const MlpShape shape(3, {5}, 4);
  TrainedNetwork<double> network(shape, {.learning_rate = 1e-3}, rng);
  const Vector parameters = network.parameters();
  BasicBatch<double> batch;
  batch.Resize({3, 2, 0}, 6, /*with_keys=*/false);
  batch.observations = Matrix::NullaryExpr(3, 6, [&] { return rng.Normal(); });
  batch.actions = Matrix::NullaryExpr(2, 6, [&] { return 1.8 * rng.Uniform() - 0.9; });
  Vector weights(6);
  weights << 0, 1, 2.5, 0.5, 0, 2;
  GaussianLikelihood<double> likelihood(kBehaviorLogStd);
  likelihood.Fit(batch, &weights, &network);
  const double loss_there = likelihood.loss();
  const auto loss = [&](const Matrix& at) {
    MlpActivations<double> activations;
    GaussianHead<double> head;
    head.Split(MlpForward<double>(shape, at.data(), batch.observations, &activations), kBehaviorLogStd);
    Vector log_prob;
    GaussianGradient<double> unused;
    TanhLogProb<double>(head.view(), batch.actions, &log_prob, &unused);
    return -weights.dot(log_prob) / 6;
  };
  EXPECT_NEAR(loss_there, loss(parameters), 1e-12);
  ExpectIsGradient(network.gradient(), loss, parameters);
}

template <class Dbr>
class Ablations : public testing::Test {
 protected:
  static constexpr ActionKind kKind =
      std::is_same_v<Dbr, DiscreteDbr<double>> ? ActionKind::kDiscrete : ActionKind::kContinuous;

  Ablations() { spec_.config.mutable_dbr()->set_target_samples(2); }

  DbrConfig* config() { return spec_.config.mutable_dbr(); }
  BasicBatch<double> Random(int n = 16) { return RandomBatch<double>(spec_, n, rng_); }

  static std::vector<float> Network(const Dbr& dbr, const char* name) {
    PolicySnapshot snapshot;
    dbr.ExportPolicy(&snapshot);
    return *snapshot.Find(name);
  }
  static double Metric(const Dbr& dbr, const std::string& name) {
    for (const UpdateMetric& metric : dbr.metrics()) {
      if (name == metric.name) return metric.value;
    }
    ADD_FAILURE() << name;
    return 0;
  }
  // Returns the networks after one update on the same batches.
  std::vector<float> AfterOne(const BasicBatch<double>& uniform, const BasicBatch<double>& other,
                              const char* network, double* target = nullptr) {
    Dbr dbr(spec_);
    EXPECT_TRUE(dbr.Update(uniform, other, other).ok());
    if (target != nullptr) *target = Metric(dbr, "train/target_mean");
    return Network(dbr, network);
  }

  AlgorithmSpec spec_ = SmallSpec(1, kKind);
  Rng rng_{17};
};

using Both = testing::Types<DiscreteDbr<double>, ContinuousDbr<double>>;
TYPED_TEST_SUITE(Ablations, Both);

TYPED_TEST(Ablations, SelfImitationsAdvantageIsTheScaledReturnLessTheStatesValue) {
  this->config()->set_advantage(DbrConfig::SIL);
  this->spec_.config.set_reward_scale(3);
  BasicBatch<double> uniform = this->Random();
  const BasicBatch<double> other = this->Random();
  TypeParam dbr(this->spec_), moved(this->spec_);
  ASSERT_TRUE(dbr.Update(uniform, other, other).ok());
  uniform.returns.array() += 0.5;
  ASSERT_TRUE(moved.Update(uniform, other, other).ok());
  ASSERT_EQ(dbr.advantages().size(), 16u);
  for (int i = 0; i < 16; ++i) EXPECT_NEAR(moved.advantages()[i] - dbr.advantages()[i], 3 * 0.5, 1e-5);
  // V is the same for both, so the mean of 3 R - A is the mean of the values in the metrics.
  double value = 0;
  for (int i = 0; i < 16; ++i) value += 3 * uniform.returns[i] - moved.advantages()[i];
  EXPECT_LE(value / 16, this->Metric(moved, "train/value_mean") + 1e-5)
      << "the mean of minima is the smaller";
  EXPECT_NEAR(value / 16, this->Metric(moved, "train/value_mean"), 1);
}

TYPED_TEST(Ablations, SelfImitationFitsBetaPlusToWhatDidBetterInTheWholeBatch) {
  this->config()->set_advantage(DbrConfig::SIL);
  const BasicBatch<double> other = this->Random(), another = this->Random();
  BasicBatch<double> uniform = this->Random();
  uniform.returns.setConstant(-100);
  const auto untouched = this->Network(TypeParam(this->spec_), kBetaPlus);
  EXPECT_EQ(this->AfterOne(uniform, other, kBetaPlus), untouched) << "there is nothing to imitate";
  uniform.returns[3] = 100;
  const auto fitted = this->AfterOne(uniform, other, kBetaPlus);
  EXPECT_NE(fitted, untouched);
  EXPECT_EQ(this->AfterOne(uniform, another, kBetaPlus), fitted) << "D+ is not asked";
  EXPECT_EQ(TypeParam(this->spec_).needs().plus, 0);
  EXPECT_EQ(TypeParam(this->spec_).needs().minus, 16);
}

TYPED_TEST(Ablations, SelfImitationLearnsTheActionThatPaid) {
  this->config()->set_advantage(DbrConfig::SIL);
  this->spec_.config.set_learning_rate(3e-3);
  BasicBatch<double> uniform = this->Random(32);
  for (int i = 0; i < 32; ++i) {
    const bool first = i % 2 == 0;
    uniform.actions.col(i).setConstant(TestFixture::kKind == ActionKind::kDiscrete ? (first ? 0 : 1)
                                                                                   : (first ? 0.5 : -0.5));
    uniform.returns[i] = first ? 5 : -5;
  }
  TypeParam dbr(this->spec_);
  ASSERT_TRUE(dbr.Update(uniform, uniform, uniform).ok());
  const double before = this->Metric(dbr, "train/beta_plus_loss");
  for (int i = 0; i < 400; ++i) ASSERT_TRUE(dbr.Update(uniform, uniform, uniform).ok());
  EXPECT_LT(this->Metric(dbr, "train/beta_plus_loss"), before - 0.5);
  for (int i = 0; i < 32; ++i) EXPECT_EQ(dbr.advantages()[i] > 0, i % 2 == 0);
}

// The clipped log is in [-1, 0]. So the mean target moves by a value in [-weight, 0], and twice the weight
// moves it twice as far.
TYPED_TEST(Ablations, TheMunchausenTermLowersTheTargetsByTheWeightedLog) {
  this->spec_.config.set_reward_scale(2);
  const BasicBatch<double> uniform = this->Random(), other = this->Random();
  double plain = 0, half = 0, whole = 0;
  this->AfterOne(uniform, other, kPolicyNetwork, &plain);
  this->config()->set_munchausen_weight(0.5);
  this->AfterOne(uniform, other, kPolicyNetwork, &half);
  this->config()->set_munchausen_weight(1);
  this->AfterOne(uniform, other, kPolicyNetwork, &whole);
  EXPECT_LT(half, plain - 0.05);
  EXPECT_GE(whole, plain - 2 - 1e-9);
  EXPECT_NEAR(whole - plain, 2 * (half - plain), 1e-9);
}

TYPED_TEST(Ablations, TheMunchausenTermIsBetaPlussOfTheSameUpdate) {
  this->config()->set_munchausen_weight(0.9);
  const BasicBatch<double> uniform = this->Random(), other = this->Random();
  double with = 0, without = 0;
  const std::vector<float> beta_plus = this->AfterOne(uniform, other, kBetaPlus, &with);
  this->config()->set_munchausen_weight(0);
  this->AfterOne(uniform, other, kBetaPlus, &without);
  Vector parameters(static_cast<Eigen::Index>(beta_plus.size()));
  for (std::size_t i = 0; i < beta_plus.size(); ++i) parameters[static_cast<Eigen::Index>(i)] = beta_plus[i];
  const bool discrete = TestFixture::kKind == ActionKind::kDiscrete;
  const MlpShape shape(5, {8, 8}, discrete ? 3 : 4);
  MlpActivations<double> activations;
  const Matrix output = MlpForward<double>(shape, parameters.data(), uniform.observations, &activations);
  Vector log_prob(uniform.size());
  if (discrete) {
    Categorical<double> beta;
    MaskedSoftmax<double>(output, uniform.masks, &beta);
    for (int i = 0; i < uniform.size(); ++i)
      log_prob[i] = beta.log_probabilities(static_cast<int>(uniform.actions(0, i)), i);
  } else {
    GaussianHead<double> head;
    head.Split(output, kBehaviorLogStd);
    GaussianGradient<double> unused;
    TanhLogProb<double>(head.view(), uniform.actions, &log_prob, &unused);
  }
  double expected = 0;
  for (const double log : log_prob) expected += 0.9 * std::clamp(log, -1.0, 0.0) / 16;
  EXPECT_NEAR(with - without, expected, 1e-6);  // the exported parameters are floats
}

TYPED_TEST(Ablations, WithoutAConstraintNeitherBehaviourNorMultiplierMatter) {
  this->config()->set_constraint(DbrConfig::NONE);
  const BasicBatch<double> uniform = this->Random(), other = this->Random(), another = this->Random();
  const auto policy = this->AfterOne(uniform, other, kPolicyNetwork);
  EXPECT_EQ(this->AfterOne(uniform, another, kPolicyNetwork), policy);
  this->config()->set_first_multiplier(1000);
  this->config()->set_value_penalty(true);
  EXPECT_EQ(this->AfterOne(uniform, other, kPolicyNetwork), policy);
  TypeParam dbr(this->spec_);
  ASSERT_TRUE(dbr.Update(uniform, other, other).ok());
  EXPECT_EQ(this->Metric(dbr, "train/multiplier"), 0);
  EXPECT_EQ(this->Metric(dbr, "train/threshold"), 0);
  EXPECT_GT(this->Metric(dbr, "train/divergence_plus"), 0) << "still measured";
  TensorFile state;
  dbr.Save(&state);
  EXPECT_NEAR(state.tensors.at("log_alpha")[0], std::log(1000), 1e-4) << "not stepped";
  this->config()->set_constraint(DbrConfig::FIXED);
  EXPECT_NE(this->AfterOne(uniform, other, kPolicyNetwork), policy);
}

TYPED_TEST(Ablations, EntropyRegularisesThePolicyWithoutAConstraint) {
  this->config()->set_constraint(DbrConfig::NONE);
  this->spec_.config.set_learning_rate(3e-3);
  const BasicBatch<double> uniform = this->Random(), other = this->Random();
  double entropy[2];
  for (const int i : {0, 1}) {
    this->config()->set_entropy_weight(i == 0 ? 0 : 5);
    TypeParam dbr(this->spec_);
    for (int k = 0; k < 100; ++k) ASSERT_TRUE(dbr.Update(uniform, other, other).ok());
    entropy[i] = this->Metric(dbr, "train/policy_entropy");
  }
  EXPECT_GT(entropy[1], entropy[0]);
}

// A transition of several steps has their rewards in one sum, to which the term of one action does not
// belong.
TEST(MunchausenTest, NeedsTransitionsOfOneStep) {
  for (const ActionKind actions : {ActionKind::kDiscrete, ActionKind::kContinuous}) {
    AlgorithmSpec spec = SmallSpec(1, actions);
    spec.config.mutable_dbr();
    spec.config.set_n_step(3);
    EXPECT_TRUE(MakeAlgorithm(spec).ok());
    spec.config.mutable_dbr()->set_munchausen_weight(0.9);
    const absl::Status status = MakeAlgorithm(spec).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_THAT(std::string(status.message()), testing::HasSubstr("algorithm.n_step: expected 1 with"));
    spec.config.set_n_step(1);
    EXPECT_TRUE(MakeAlgorithm(spec).ok());
  }
}

TEST(NormalizedSelfImitation, ReturnsReachTheAlgorithmBehindTheNormalizer) {
  AlgorithmSpec spec = SmallSpec();
  spec.config.mutable_dbr()->set_advantage(DbrConfig::SIL);
  spec.normalize_observations = true;
  const auto algorithm = MakeAlgorithm(spec);
  ASSERT_TRUE(algorithm.ok()) << algorithm.status();
  Rng rng(1);
  const Batch minus = RandomBatch<float>(spec, 16, rng), none;
  Batch uniform = RandomBatch<float>(spec, 16, rng);
  for (const float value : {100.0f, -100.0f}) {
    uniform.returns.setConstant(value);
    ASSERT_TRUE((*algorithm)->Update({uniform, none, minus}).ok());
    for (const float advantage : (*algorithm)->advantages()) EXPECT_NEAR(advantage, value, 10);
  }
}

}  // namespace
}  // namespace dbr
