// Tests DBR's whole policy loss by differences in double, for each constraint with each divergence, with the
// repulsion from beta- off, on and capped, and with normalize_q on and off. discrete_losses_test and
// continuous_losses_test test single cases of these. Epsilon is such that D(pi, beta-) is the threshold of
// both dynamic constraints.
#include <gtest/gtest.h>

#include <algorithm>
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
using Vector = VectorX<double>;

// How beta- repels the policy: not at all, everywhere, or at the nearer half of the states.
enum class Repulsion { kNone, kWhole, kCapped };
using Grid = std::tuple<DbrConfig::Constraint, DbrConfig::Divergence, Repulsion, bool>;

constexpr int kStates = 4;
constexpr double kEntropyWeight = 0.2;

Matrix Normal(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return Matrix::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

// Returns alpha, which is 0 without a constraint.
double AlphaOf(const Grid& grid) {
  return std::get<0>(grid) == DbrConfig::NONE ? 0 : 1.7;
}

bool IsDynamic(const Grid& grid) {
  return IsMovedByMinus(std::get<0>(grid));
}

std::string NameOf(const testing::TestParamInfo<Grid>& info) {
  const auto [constraint, divergence, repulsion, normalize_q] = info.param;
  return DbrConfig::Constraint_Name(constraint) + "_" + DbrConfig::Divergence_Name(divergence) +
         (repulsion == Repulsion::kNone     ? ""
          : repulsion == Repulsion::kCapped ? "_RepelsBelowACap"
                                            : "_Repels") +
         (normalize_q ? "_NormalizesQ" : "");
}

// Returns a value between the second and the third of D(pi, beta-) [kStates] by size.
double CapBetween(Vector minus) {
  std::sort(minus.begin(), minus.end());
  EXPECT_LT(minus[1] + 1e-4, minus[2]);
  return (minus[1] + minus[2]) / 2;
}

class WholeLoss : public testing::TestWithParam<Grid> {
 protected:
  // Sets the options. `minus` is D(pi, beta-) at each state of the point of the gradient.
  void SetOptions(const Vector& minus, bool use_q) {
    const auto [constraint, divergence, repulsion, normalize_q] = GetParam();
    options_ = {.constraint = constraint,
                .divergence = divergence,
                .epsilon = constraint == DbrConfig::DYNAMIC_MIN ? 50 : 1e-4,
                .mmd_sigma = kSigma,
                .repel_negative = repulsion != Repulsion::kNone,
                .max_repulsion = repulsion == Repulsion::kCapped ? CapBetween(minus) : 0,
                .normalize_q = normalize_q,
                .entropy_weight = kEntropyWeight,
                .use_q = use_q};
  }

  // Returns the threshold of a dynamic constraint.
  double ThresholdAt(const Vector& minus) const {
    return options_.max_repulsion > 0 ? minus.cwiseMin(options_.max_repulsion).mean() : minus.mean();
  }

  // Returns the loss at `moved`, computed again from its terms. `minus` is D(pi, beta-) there. Everything
  // that the definition holds constant is taken from `at`, the point of the gradient: the scale of Q, and the
  // threshold unless repel_negative is set.
  double Objective(const PolicyLoss<double>& moved, const Vector& minus, const PolicyLoss<double>& at,
                   double scale) const {
    const bool repels = IsDynamic(GetParam()) && options_.repel_negative;
    const double threshold = repels ? ThresholdAt(minus) : at.threshold;
    const double soft_value = (moved.value + kEntropyWeight * moved.entropy) / scale;
    return (options_.use_q ? -soft_value : 0) + AlphaOf(GetParam()) * (moved.divergence_plus - threshold);
  }

  void ExpectIsOfItsTerms(const PolicyLoss<double>& at, const Vector& minus, double scale) const {
    EXPECT_NEAR(at.loss, Objective(at, minus, at, scale), 1e-12);
    if (!IsDynamic(GetParam())) return;
    EXPECT_NEAR(at.threshold, ThresholdAt(minus), 1e-12);
    EXPECT_NEAR(at.divergence_minus, minus.mean(), 1e-12) << "the cap is the threshold's alone";
  }

  static constexpr double kSigma = 1.5;
  PolicyLossOptions options_;
};

class DiscreteLoss : public WholeLoss {
 protected:
  static constexpr int kActions = 4;

  DiscreteLoss() { masks_(2, 1) = 0; }

  Categorical<double> Softmax(const Matrix& logits) const {
    Categorical<double> p;
    MaskedSoftmax<double>(logits, masks_, &p);
    return p;
  }
  PolicyLoss<double> Loss(const Matrix& at, Matrix* gradient) const {
    PolicyLossWorkspace<double> workspace;
    return DualBehaviorPolicyLoss<double>(options_, Softmax(at), q1_, q2_, plus_, minus_, AlphaOf(GetParam()),
                                          &workspace, gradient);
  }
  Vector MinusAt(const Matrix& logits) const {
    Vector divergence;
    Divergence<double>(std::get<1>(GetParam()), kSigma, Softmax(logits), minus_, &divergence, nullptr);
    return divergence;
  }
  // Returns the mean under pi of the absolute value of the twin with the smaller expectation, or 1.
  double Scale() const {
    if (!options_.normalize_q) return 1;
    const Matrix p = Softmax(logits_).probabilities;
    double scale = 0;
    for (int j = 0; j < kStates; ++j) {
      const auto& smaller = p.col(j).dot(q1_.col(j)) <= p.col(j).dot(q2_.col(j)) ? q1_ : q2_;
      scale += p.col(j).dot(smaller.col(j).cwiseAbs()) / kStates;
    }
    return scale;
  }
  void ExpectAgreesWithDifferences(bool use_q) {
    SetOptions(MinusAt(logits_), use_q);
    Matrix gradient, unused;
    const PolicyLoss<double> at = Loss(logits_, &gradient);
    ExpectIsOfItsTerms(at, MinusAt(logits_), Scale());
    ExpectIsGradient(
        gradient,
        [&](const Matrix& moved) { return Objective(Loss(moved, &unused), MinusAt(moved), at, Scale()); },
        logits_);
  }

  Rng rng_{31};
  Matrix masks_ = Matrix::Ones(kActions, kStates);
  const Matrix q1_ = Normal(kActions, kStates, rng_), q2_ = Normal(kActions, kStates, rng_);
  const Categorical<double> plus_ = Softmax(Normal(kActions, kStates, rng_)),
                            minus_ = Softmax(Normal(kActions, kStates, rng_));
  const Matrix logits_ = Normal(kActions, kStates, rng_);
};

TEST_P(DiscreteLoss, GradientAgreesWithDifferences) {
  ExpectAgreesWithDifferences(/*use_q=*/true);
}

TEST_P(DiscreteLoss, TheWarmStartHasNeitherQNorEntropy) {
  ExpectAgreesWithDifferences(/*use_q=*/false);
}

class ContinuousLoss : public WholeLoss {
 protected:
  static constexpr int kObservation = 3, kDimensions = 2, kDraws = 3;

  ContinuousLoss() {
    plus_.Split(0.5 * Normal(2 * kDimensions, kStates, rng_), kBehaviorLogStd);
    minus_.Split(0.5 * Normal(2 * kDimensions, kStates, rng_), kBehaviorLogStd);
  }

  Matrix Noise() { return Normal(kDimensions, kDraws * kStates, rng_); }
  static GaussianHead<double> HeadOf(const Matrix& output) {
    GaussianHead<double> head;
    head.Split(output, kPolicyLogStd);
    return head;
  }
  PolicyLoss<double> Loss(const Matrix& at, Matrix* gradient) {
    const Matrix none;
    return objective_.Compute(options_, {HeadOf(at), plus_, minus_}, observations_, {none, Vector()}, noise_,
                              AlphaOf(GetParam()), &critics_, gradient);
  }
  Vector MinusAt(const Matrix& output) const {
    GaussianDivergence<double> divergence;
    divergence.Compute({std::get<1>(GetParam()), kSigma}, HeadOf(output), minus_, {noise_.pi, noise_.minus});
    return divergence.value();
  }
  // Returns the mean over states of the absolute value of the smaller twin's mean over the draws, or 1. It is
  // of the draws of the newest Loss.
  double Scale() const {
    if (!options_.normalize_q) return 1;
    double scale = 0;
    for (int j = 0; j < kStates; ++j) {
      double mean1 = 0, mean2 = 0;
      for (int k = j; k < kDraws * kStates; k += kStates) {
        mean1 += critics_.value1()(0, k) / kDraws;
        mean2 += critics_.value2()(0, k) / kDraws;
      }
      scale += std::abs(std::min(mean1, mean2)) / kStates;
    }
    return scale;
  }
  void ExpectAgreesWithDifferences(bool use_q) {
    SetOptions(MinusAt(output_), use_q);
    Matrix gradient, unused;
    const PolicyLoss<double> at = Loss(output_, &gradient);
    const double scale = Scale();
    ExpectIsOfItsTerms(at, MinusAt(output_), scale);
    ExpectIsGradient(
        gradient,
        [&](const Matrix& moved) { return Objective(Loss(moved, &unused), MinusAt(moved), at, scale); },
        output_);
  }

  Rng rng_{32};
  PairRunner runner_{1};
  CriticEnsemble<double> critics_{MlpShape(kObservation + kDimensions, {6, 6}, 1),
                                  {.learning_rate = 1e-3, .with_target = true},
                                  rng_,
                                  &runner_};
  const Matrix observations_ = Normal(kObservation, kStates, rng_);
  const ObjectiveNoise<double> noise_{Noise(), Noise(), Noise(), Noise()};
  const Matrix output_ = 0.5 * Normal(2 * kDimensions, kStates, rng_);
  GaussianHead<double> plus_, minus_;
  DualBehaviorObjective<double> objective_;
};

TEST_P(ContinuousLoss, GradientAgreesWithDifferences) {
  ExpectAgreesWithDifferences(/*use_q=*/true);
}

TEST_P(ContinuousLoss, TheWarmStartHasNeitherQNorEntropy) {
  ExpectAgreesWithDifferences(/*use_q=*/false);
}

const auto kConstraints =
    testing::Values(DbrConfig::DYNAMIC_MAX, DbrConfig::DYNAMIC_MIN, DbrConfig::FIXED, DbrConfig::NONE);
const auto kRepulsions = testing::Values(Repulsion::kNone, Repulsion::kWhole, Repulsion::kCapped);

INSTANTIATE_TEST_SUITE_P(Grid, DiscreteLoss,
                         testing::Combine(kConstraints,
                                          testing::Values(DbrConfig::KL, DbrConfig::MMD_EXACT,
                                                          DbrConfig::MMD_SQUARED),
                                          kRepulsions, testing::Bool()),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(Grid, ContinuousLoss,
                         testing::Combine(kConstraints,
                                          testing::Values(DbrConfig::KL, DbrConfig::MMD_EXACT,
                                                          DbrConfig::MMD_SQUARED, DbrConfig::MMD_LAPLACIAN,
                                                          DbrConfig::MMD_GAUSSIAN),
                                          kRepulsions, testing::Bool()),
                         NameOf);

// The capped D(pi, beta-) is what epsilon is compared with.
TEST(CappedRepulsion, AThresholdThatTheCapBringsBelowEpsilonIsEpsilon) {
  Rng rng(33);
  const Matrix q = Normal(3, kStates, rng);
  const auto softmax = [](const Matrix& logits) {
    Categorical<double> p;
    MaskedSoftmax<double>(logits, Matrix::Ones(3, kStates), &p);
    return p;
  };
  const auto pi = softmax(Normal(3, kStates, rng)), plus = softmax(Normal(3, kStates, rng)),
             minus = softmax(Normal(3, kStates, rng));
  PolicyLossWorkspace<double> workspace;
  Matrix capped, constant;
  PolicyLossOptions options{.epsilon = 1e-3, .repel_negative = true, .max_repulsion = 1e-4};
  const auto loss = [&](Matrix* gradient) {
    return DualBehaviorPolicyLoss<double>(options, pi, q, q, plus, minus, 1.5, &workspace, gradient);
  };
  EXPECT_EQ(loss(&capped).threshold, 1e-3);
  options.repel_negative = false;
  options.constraint = DbrConfig::FIXED;
  loss(&constant);
  EXPECT_EQ(capped, constant);
}

}  // namespace
}  // namespace dbr
