// Tests how a batch's own advantages sort it into D+ and D-.
#include "learner/objectives/batch_partition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace dbr {
namespace {

using testing::Each;
using testing::ElementsAre;

BatchPartition<double> PartitionOf(const std::vector<float>& advantages, float margin = 0) {
  BatchPartition<double> partition;
  partition.Split(advantages, margin);
  return partition;
}

TEST(BatchPartitionTest, WeighsTheTransitionsOfEachPartToAMeanOf1) {
  const BatchPartition<double> partition = PartitionOf({2, -1, -3, -0.5f});
  EXPECT_THAT(partition.plus(), ElementsAre(4, 0, 0, 0));
  EXPECT_THAT(partition.minus(), ElementsAre(0, testing::DoubleEq(4.0 / 3), testing::DoubleEq(4.0 / 3),
                                             testing::DoubleEq(4.0 / 3)));
  EXPECT_TRUE(partition.has_plus() && partition.has_minus());
}

TEST(BatchPartitionTest, AnAdvantageOf0IsInBothParts) {
  const BatchPartition<double> partition = PartitionOf({0, 1});
  EXPECT_THAT(partition.plus(), ElementsAre(1, 1));
  EXPECT_THAT(partition.minus(), ElementsAre(2, 0));
}

TEST(BatchPartitionTest, AMarginKeepsWhatIsHardlyBadOutOfDMinus) {
  const BatchPartition<double> partition = PartitionOf({0, 1, -0.4f, -0.5f}, 0.5f);
  EXPECT_THAT(partition.plus(), ElementsAre(2, 2, 0, 0));
  EXPECT_THAT(partition.minus(), ElementsAre(0, 0, 0, 4));
}

TEST(BatchPartitionTest, AnEmptyPartHasNoWeight) {
  BatchPartition<double> partition = PartitionOf({1, 2});
  EXPECT_TRUE(partition.has_plus());
  EXPECT_FALSE(partition.has_minus());
  EXPECT_THAT(partition.minus(), Each(0));
  partition.Split(std::vector<float>{-1, -2}, 0);
  EXPECT_FALSE(partition.has_plus());
  EXPECT_THAT(partition.plus(), Each(0));
  EXPECT_THAT(partition.minus(), Each(1));
}

TEST(BatchPartitionTest, IsReusedForAnotherSize) {
  BatchPartition<double> partition = PartitionOf({1, 2});
  partition.Split(std::vector<float>{1, -2, 3}, 0);
  EXPECT_THAT(partition.plus(), ElementsAre(1.5, 0, 1.5));
}

}  // namespace
}  // namespace dbr
