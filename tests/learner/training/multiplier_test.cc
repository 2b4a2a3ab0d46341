// Tests the multiplier of a constraint: its limits, that nothing gathers at them, and its state on disk.
#include "learner/training/multiplier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace dbr {
namespace {

constexpr double kLearningRate = 0.1;

template <class Scalar>
TensorFile StateOf(const Multiplier<Scalar>& multiplier) {
  TensorFile file;
  multiplier.Save(&file);
  return file;
}

template <class Scalar>
float LogOf(const Multiplier<Scalar>& multiplier) {
  return StateOf(multiplier).tensors.at("log_alpha")[0];
}

template <class Scalar>
class MultiplierTest : public testing::Test {
 protected:
  static Multiplier<Scalar> Make(double first, double min, double max) {
    return Multiplier<Scalar>(first, kLearningRate, MultiplierLimits::Between(min, max));
  }
};

using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(MultiplierTest, Scalars);

TYPED_TEST(MultiplierTest, StartsAtItsFirstValue) {
  for (const double min : {0.0, 0.25, 1.5}) {
    EXPECT_NEAR(this->Make(1.5, min, 4).value(), 1.5, 1e-6) << min;
  }
}

TYPED_TEST(MultiplierTest, GoesAgainstItsViolationAndStaysBetweenItsLimits) {
  for (const double min : {0.0, 0.25}) {
    auto multiplier = this->Make(1, min, 4);
    double before = multiplier.value();
    for (int i = 0; i < 100; ++i) {
      multiplier.Step(1);
      EXPECT_GE(multiplier.value(), before);
      EXPECT_LE(multiplier.value(), 4 + 1e-6);
      before = multiplier.value();
    }
    EXPECT_NEAR(multiplier.value(), 4, 1e-6);
    for (int i = 0; i < 1000; ++i) {
      multiplier.Step(-1);
      EXPECT_GE(multiplier.value(), min - 1e-7);
    }
    EXPECT_NEAR(multiplier.value(), min, 1e-7);
  }
}

TYPED_TEST(MultiplierTest, AFloorOf0IsReachedExactly) {
  auto multiplier = this->Make(1, 0, 100);
  for (int i = 0; i < 500 && multiplier.value() > 0; ++i) multiplier.Step(-1);
  EXPECT_EQ(multiplier.value(), 0);
  multiplier.Step(-1);
  EXPECT_EQ(multiplier.value(), 0);
}

TYPED_TEST(MultiplierTest, AFloorOf0IsLeftAgainWithinAFewSteps) {
  auto multiplier = this->Make(1, 0, 100);
  for (int i = 0; i < 1000; ++i) multiplier.Step(-1);
  ASSERT_EQ(multiplier.value(), 0);
  // Adam's first moment still points down.
  int steps = 0;
  for (; steps < 1000 && multiplier.value() == 0; ++steps) multiplier.Step(1);
  EXPECT_LE(steps, 20);
}

// 1,000 steps that push beyond a limit where the multiplier stands already: Adam keeps nothing of them, and
// the first step back is Adam's first one, which is a whole learning rate long.
TYPED_TEST(MultiplierTest, NothingGathersAtALimit) {
  constexpr double kMin = 0.25, kMax = 4;
  for (const double limit : {kMin, kMax}) {
    auto multiplier = this->Make(limit, kMin, kMax);
    const int outwards = limit == kMax ? 1 : -1;
    const TensorFile before = StateOf(multiplier);
    for (int i = 0; i < 1000; ++i) multiplier.Step(static_cast<TypeParam>(outwards));
    EXPECT_EQ(StateOf(multiplier).tensors, before.tensors) << limit;
    EXPECT_EQ(StateOf(multiplier).metadata, before.metadata) << limit;
    multiplier.Step(static_cast<TypeParam>(-outwards));
    EXPECT_NEAR(LogOf(multiplier) - std::log(limit), -outwards * kLearningRate, 1e-5) << limit;
  }
}

// The same where steps have led to the limit: Adam's moments are those of the way there.
TYPED_TEST(MultiplierTest, NothingGathersAtALimitThatStepsHaveReached) {
  for (const int outwards : {1, -1}) {
    auto waits = this->Make(1, 0, 4);
    for (int i = 0; i < 500; ++i) waits.Step(static_cast<TypeParam>(outwards));
    auto turns = waits;
    for (int i = 0; i < 1000; ++i) waits.Step(static_cast<TypeParam>(outwards));
    for (int i = 0; i < 30; ++i) {
      waits.Step(static_cast<TypeParam>(-outwards));
      turns.Step(static_cast<TypeParam>(-outwards));
      EXPECT_EQ(waits.value(), turns.value()) << "step " << i << " back from the " << outwards << " side";
    }
    EXPECT_EQ(StateOf(waits).tensors, StateOf(turns).tensors);
  }
}

TYPED_TEST(MultiplierTest, NoViolationMovesNothingAtTheStart) {
  auto multiplier = this->Make(1, 0.5, 4);
  multiplier.Step(0);
  EXPECT_EQ(LogOf(multiplier), 0);
}

TYPED_TEST(MultiplierTest, ANaNReachesTheValue) {
  for (const double first : {0.25, 1.0, 4.0}) {
    auto multiplier = this->Make(first, 0.25, 4);
    multiplier.Step(static_cast<TypeParam>(NAN));
    EXPECT_TRUE(std::isnan(multiplier.value())) << first;
  }
}

TYPED_TEST(MultiplierTest, TwoOfThemAreInOneFileByTheirNames) {
  auto first = this->Make(1, 0.25, 4), second = this->Make(2, 0, 4);
  for (int i = 0; i < 3; ++i) {
    first.Step(1);
    second.Step(-1);
  }
  second.Step(-1);
  TensorFile file;
  first.Save(&file);
  second.Save(&file, "log_other");
  auto loaded_first = this->Make(3, 0.25, 4), loaded_second = this->Make(3, 0, 4);
  ASSERT_TRUE(loaded_first.Load(file).ok());
  ASSERT_TRUE(loaded_second.Load(file, "log_other").ok());
  TensorFile again;
  loaded_first.Save(&again);
  loaded_second.Save(&again, "log_other");
  EXPECT_EQ(again.tensors, file.tensors);
  EXPECT_EQ(again.metadata, file.metadata);
  EXPECT_NEAR(loaded_first.value(), first.value(), 1e-6);
  EXPECT_NEAR(loaded_second.value(), second.value(), 1e-6);
  EXPECT_NE(file.tensors.at("log_alpha"), file.tensors.at("log_other"));
}

TYPED_TEST(MultiplierTest, LoadingNamesWhatIsMissing) {
  auto multiplier = this->Make(1, 0, 4);
  EXPECT_THAT(std::string(multiplier.Load(StateOf(multiplier), "log_other").message()),
              testing::HasSubstr("'log_other'"));
  for (const std::string part : {".adam.first", ".adam.second"}) {
    TensorFile file = StateOf(multiplier);
    file.tensors.erase("log_alpha" + part);
    EXPECT_THAT(std::string(multiplier.Load(file).message()), testing::HasSubstr("'log_alpha" + part + "'"));
  }
}

}  // namespace
}  // namespace dbr
