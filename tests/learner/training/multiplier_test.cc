#include "learner/training/multiplier.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dbr {
namespace {

constexpr double kRate = 0.1;

TEST(Multiplier, GrowsWithAViolationAndFallsWithoutOne) {
  Multiplier<double> multiplier(1, kRate);
  multiplier.Step(0.5);
  EXPECT_NEAR(multiplier.value(), std::exp(kRate), 1e-6);  // Adam's first step is one learning rate
  for (int i = 0; i < 100; ++i) multiplier.Step(-0.5);
  EXPECT_LT(multiplier.value(), 1);
}

TEST(Multiplier, StaysBetweenItsLimits) {
  Multiplier<double> multiplier(1, kRate, MultiplierLimits::Between(0.5, 2));
  for (int i = 0; i < 100; ++i) multiplier.Step(1);
  EXPECT_NEAR(multiplier.value(), 2, 1e-12);
  for (int i = 0; i < 100; ++i) multiplier.Step(-1);
  EXPECT_NEAR(multiplier.value(), 0.5, 1e-12);
}

TEST(Multiplier, AMinimumOf0IsReachedAndLeft) {
  Multiplier<double> multiplier(0.1, kRate, MultiplierLimits::Between(0, 100));
  EXPECT_NEAR(multiplier.value(), 0.1, 1e-12);
  for (int i = 0; i < 1000; ++i) multiplier.Step(-1);
  EXPECT_EQ(multiplier.value(), 0);
  for (int i = 0; i < 20; ++i) multiplier.Step(1);
  EXPECT_GT(multiplier.value(), 0);
  for (int i = 0; i < 200; ++i) multiplier.Step(1);
  EXPECT_GT(multiplier.value(), 0.1);
}

// Steps that push against a limit gather nothing: the way back is the same after 20 of them and after 1,000.
TEST(Multiplier, DoesNotWindUpAtALimit) {
  for (const double outwards : {1.0, -1.0}) {
    const auto back_after = [&](int steps) {
      Multiplier<double> multiplier(1, kRate, MultiplierLimits::Between(0.5, 2));
      for (int i = 0; i < steps; ++i) multiplier.Step(outwards);
      for (int i = 0; i < 10; ++i) multiplier.Step(-outwards);
      return multiplier.value();
    };
    const double soon = back_after(20);
    EXPECT_EQ(back_after(1000), soon);
    EXPECT_GT(soon, 0.51);
    EXPECT_LT(soon, 1.99);
  }
}

TEST(Multiplier, TwoOfThemLieInOneFileByName) {
  Multiplier<double> one(1, kRate), other(2, kRate), read_one(5, kRate), read_other(5, kRate);
  one.Step(1);
  other.Step(-1);
  TensorFile file;
  one.Save(&file);
  other.Save(&file, "log_temperature");
  ASSERT_TRUE(read_one.Load(file).ok());
  ASSERT_TRUE(read_other.Load(file, "log_temperature").ok());
  one.Step(0.3);
  read_one.Step(0.3);
  // A file holds float32.
  EXPECT_NEAR(read_one.value(), one.value(), 1e-6);
  EXPECT_NEAR(read_other.value(), other.value(), 1e-6);
}

}  // namespace
}  // namespace dbr
