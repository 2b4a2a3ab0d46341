// Expected values were worked out by NumPy 1.24 and SciPy 1.10: numpy.mean, numpy.std(ddof=1),
// numpy.quantile, scipy.stats.trim_mean(x, 0.25).
#include "deploy/report/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace dbr {
namespace {

const std::vector<double>& Values() {
  static const auto* values = new std::vector<double>{3.1, -0.4, 12.5, 7.7, 5.2, 9.9, 1.3};
  return *values;
}

std::vector<double> First(int n) {
  return {Values().begin(), Values().begin() + n};
}

TEST(StatisticsTest, MeanAndSampleStdAreNumPys) {
  EXPECT_DOUBLE_EQ(Mean(Values()), 5.614285714285714);
  EXPECT_DOUBLE_EQ(SampleStd(Values()), 4.679896213745405);
  EXPECT_DOUBLE_EQ(SampleStd(First(4)), 5.603793358074511);
}

TEST(StatisticsTest, FiguresThatTooFewValuesCannotGiveAreNaN) {
  EXPECT_TRUE(std::isnan(Mean({})));
  EXPECT_TRUE(std::isnan(SampleStd({4.0})));
  EXPECT_TRUE(std::isnan(InterquartileMean({})));
  EXPECT_TRUE(std::isnan(Quantile({}, 0.5)));
}

TEST(StatisticsTest, InterquartileMeanIsSciPysTrimmedMean) {
  EXPECT_DOUBLE_EQ(InterquartileMean(First(3)), 5.066666666666666);  // nothing is cut off
  EXPECT_DOUBLE_EQ(InterquartileMean(First(4)), 5.4);
  EXPECT_DOUBLE_EQ(InterquartileMean(First(5)), 5.333333333333333);
  EXPECT_DOUBLE_EQ(InterquartileMean(Values()), 5.44);
  std::vector<double> eight = Values();
  eight.push_back(100);
  EXPECT_DOUBLE_EQ(InterquartileMean(eight), 6.475);
}

TEST(StatisticsTest, QuantilesAreNumPys) {
  EXPECT_DOUBLE_EQ(Quantile(Values(), 0), -0.4);
  EXPECT_NEAR(Quantile(Values(), 0.025), -0.145, 1e-12);
  EXPECT_DOUBLE_EQ(Quantile(Values(), 0.5), 5.2);
  EXPECT_NEAR(Quantile(Values(), 0.9), 10.94, 1e-12);
  EXPECT_DOUBLE_EQ(Quantile(Values(), 1), 12.5);
}

// The exact distribution, all 5^5 * 3^3 = 84,375 resamples listed in NumPy, has the quantiles 2.5 and 9.5; of
// 2,000 intervals from 2,000 draws of it the lower ends had a standard deviation of 0.024 and lay within
// [2.49, 2.75], the upper ones 0.23 and [8.5, 9.75].
TEST(StratifiedBootstrapTest, ComesNearTheExactDistributionOfTwoStrata) {
  const std::vector<std::vector<double>> strata = {{1, 2, 4, 8, 16}, {3, 5, 9}};
  for (int seed = 1; seed <= 5; ++seed) {
    Rng rng(seed);
    const Interval interval = StratifiedBootstrap(strata, rng);
    EXPECT_NEAR(interval.low, 2.5, 0.26);
    EXPECT_NEAR(interval.high, 9.36, 0.9);
  }
}

// Of one stratum: all 3,125 resamples have 0.89 and 0.965, as scipy.stats.bootstrap has with 100,000.
TEST(StratifiedBootstrapTest, ComesNearTheExactDistributionOfOneStratum) {
  Rng rng(1);
  const Interval interval = StratifiedBootstrap({{0.91, 0.955, 0.932, 0.97, 0.88}}, rng);
  EXPECT_NEAR(interval.low, 0.891, 0.0075);
  EXPECT_NEAR(interval.high, 0.9642, 0.0055);
}

TEST(StratifiedBootstrapTest, KeepsEveryStratumAtItsSize) {
  // Pooled resamples would draw all from one of the two now and then; stratified ones always have half from
  // each.
  const std::vector<std::vector<double>> strata = {{0, 0}, {1, 1}};
  Rng rng(1);
  const Interval interval = StratifiedBootstrap(strata, rng);
  EXPECT_EQ(interval.low, 0.5);
  EXPECT_EQ(interval.high, 0.5);
}

TEST(StratifiedBootstrapTest, OneSeedHasNoInterval) {
  Rng rng(1);
  EXPECT_TRUE(std::isnan(StratifiedBootstrap({{1.0}}, rng).low));
  EXPECT_TRUE(std::isnan(StratifiedBootstrap({}, rng).high));
  EXPECT_TRUE(std::isnan(StratifiedBootstrap({{1.0, 2.0}, {3.0}}, rng).low));
}

TEST(StratifiedBootstrapTest, TheSameSeedGivesTheSameInterval) {
  Rng one(7), other(7);
  const std::vector<std::vector<double>> strata = {Values()};
  EXPECT_EQ(StratifiedBootstrap(strata, one).low, StratifiedBootstrap(strata, other).low);
}

}  // namespace
}  // namespace dbr
