// Tests that pairs of functions run side by side, and that denormal numbers are zeros in both threads.
#include "learner/training/pair_runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <thread>

#include "nn/adam.h"

namespace dbr {
namespace {

// Half of the least normal number, computed at run time.
float HalfOfLeastNormal() {
  volatile float least = std::numeric_limits<float>::min();
  return least * 0.5f;
}

TEST(PairRunner, WithOneThreadRunsBothInTheCallers) {
  PairRunner runner(1);
  std::thread::id first, second;
  runner.Run([&] { first = std::this_thread::get_id(); }, [&] { second = std::this_thread::get_id(); });
  EXPECT_EQ(first, std::this_thread::get_id());
  EXPECT_EQ(second, std::this_thread::get_id());
}

TEST(PairRunner, WithTwoThreadsRunsTheSecondBeside) {
  PairRunner runner(2);
  std::thread::id second;
  runner.Run([] {}, [&] { second = std::this_thread::get_id(); });
  EXPECT_NE(second, std::this_thread::get_id());
}

// A thread that looks no time goes to sleep at once and must be woken. One that looks for ever does not
// sleep.
TEST(PairRunner, EachPairEndsBeforeTheNextBegins) {
  for (const int looks : {0, 1, 1 << 30}) {
    PairRunner runner(2, looks);
    int first = 0, second = 0;
    for (int round = 0; round < 5000; ++round) {
      runner.Run([&] { ++first; }, [&] { ++second; });
      ASSERT_EQ(first, round + 1) << looks << " looks";
      ASSERT_EQ(second, round + 1) << looks << " looks";
    }
  }
}

TEST(PairRunner, EndsWithoutHavingRun) {
  PairRunner runner(2);
}

TEST(FlushDenormalsTest, HoldsWhileItLives) {
  if (!FlushDenormals::Active()) EXPECT_GT(HalfOfLeastNormal(), 0.0f);
  {
    const FlushDenormals flush;
    if (!FlushDenormals::Active()) GTEST_SKIP() << "no such mode on this processor";
    EXPECT_EQ(HalfOfLeastNormal(), 0.0f);
  }
  EXPECT_FALSE(FlushDenormals::Active());
  EXPECT_GT(HalfOfLeastNormal(), 0.0f);
}

TEST(FlushDenormalsTest, HoldsInTheRunnersThread) {
  const FlushDenormals flush;
  if (!FlushDenormals::Active()) GTEST_SKIP() << "no such mode on this processor";
  PairRunner runner(2);
  bool second = false;
  runner.Run([] {}, [&] { second = FlushDenormals::Active(); });
  EXPECT_TRUE(second);
}

// A hidden unit that never fires has gradients of 0. Adam's moments of its weights must end at 0, or each of
// them costs the processor a hundred times the work for the rest of the training.
TEST(FlushDenormalsTest, AdamsMomentsOfADeadUnitEndAtZero) {
  const FlushDenormals flush;
  if (!FlushDenormals::Active()) GTEST_SKIP() << "no such mode on this processor";
  Adam<float> adam(8, 1e-3);
  VectorX<float> parameters = VectorX<float>::Ones(8);
  adam.Step(VectorX<float>::Ones(8), &parameters);
  for (int step = 0; step < 1000; ++step) adam.Step(VectorX<float>::Zero(8), &parameters);
  EXPECT_TRUE((adam.first_moment().array() == 0).all()) << adam.first_moment().transpose();
}

}  // namespace
}  // namespace dbr
