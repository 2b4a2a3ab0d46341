// Tests what a Gaussian network's output layer does with gradients at and beyond the limits of the log-std.
#include "nn/gaussian_head.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace dbr {
namespace {

using Matrix = MatrixX<double>;

constexpr LogStdLimits kLimits{-5, 2};
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Returns the gradient with respect to the network's raw log-std, where that with respect to the clipped one
// is `gradient`.
double Joined(double raw_log_std, double gradient) {
  GaussianHead<double> head;
  head.Split(Matrix{{0.3}, {raw_log_std}}, kLimits);
  Matrix joined;
  head.Join({.mean = Matrix{{0.7}}, .log_std = Matrix{{gradient}}}, &joined);
  EXPECT_EQ(joined(0, 0), 0.7) << "the mean has no limits";
  return joined(1, 0);
}

// An optimizer steps against the gradient: a gradient above 0 lowers the log-std.
TEST(GaussianHeadJoin, AboveTheGreatestLogStdOnlyAGradientThatLowersItGoesOn) {
  EXPECT_EQ(Joined(2.5, 0.4), 0.4);
  EXPECT_EQ(Joined(2.5, -0.4), 0);
  EXPECT_EQ(Joined(2.5, 0), 0);
}

TEST(GaussianHeadJoin, BelowTheSmallestLogStdOnlyAGradientThatRaisesItGoesOn) {
  EXPECT_EQ(Joined(-5.5, -0.4), -0.4);
  EXPECT_EQ(Joined(-5.5, 0.4), 0);
  EXPECT_EQ(Joined(-5.5, 0), 0);
}

TEST(GaussianHeadJoin, WithinAndAtTheLimitsEveryGradientGoesOn) {
  for (const double log_std : {-5.0, -1.0, 2.0}) {
    EXPECT_EQ(Joined(log_std, 0.4), 0.4) << log_std;
    EXPECT_EQ(Joined(log_std, -0.4), -0.4) << log_std;
  }
}

TEST(GaussianHeadJoin, ANaNGoesOnEverywhere) {
  for (const double log_std : {-5.5, -1.0, 2.5}) EXPECT_TRUE(std::isnan(Joined(log_std, kNan))) << log_std;
  EXPECT_TRUE(std::isnan(Joined(kNan, kNan)));
  EXPECT_EQ(Joined(kNan, -0.4), -0.4);
}

// Each entry has its own side.
TEST(GaussianHeadJoin, EveryEntryIsJudgedByItself) {
  GaussianHead<double> head;
  head.Split(Matrix{{0, 0}, {0, 0}, {3, -6}, {-6, 0}}, kLimits);
  Matrix joined;
  head.Join({.mean = Matrix::Zero(2, 2), .log_std = Matrix{{1, 1}, {1, -1}}}, &joined);
  EXPECT_EQ(joined.bottomRows(2), (Matrix{{1, 0}, {0, -1}}));
}

// A log-std far outside comes back: plain gradient descent on (log_std - 0)^2 of the clipped value.
TEST(GaussianHeadJoin, ALogStdThatHasLeftItsLimitsComesBack) {
  for (const double start : {4.0, -9.0}) {
    Matrix output{{0}, {start}}, joined;
    GaussianHead<double> head;
    for (int i = 0; i < 100; ++i) {
      head.Split(output, kLimits);
      head.Join({.mean = Matrix::Zero(1, 1), .log_std = 2 * head.log_std()}, &joined);
      output -= 0.1 * joined;
    }
    EXPECT_NEAR(output(1, 0), 0, 1e-3) << "from " << start;
  }
}

}  // namespace
}  // namespace dbr
