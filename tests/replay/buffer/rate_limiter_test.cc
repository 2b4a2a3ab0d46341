#include "replay/buffer/rate_limiter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

RateLimiter Make(double samples_per_insert, double tolerance, std::uint64_t min_size) {
  const auto limiter = RateLimiter::Make({samples_per_insert, tolerance, min_size}, 1000000);
  EXPECT_TRUE(limiter.ok()) << limiter.status();
  return *limiter;
}

TEST(RateLimiter, HoldsDrawsUntilTheMinimumSize) {
  const RateLimiter limiter = Make(0, 0, 10);
  EXPECT_FALSE(limiter.CanDraw({.inserted = 9, .sampled = 0, .size = 9}, 1));
  EXPECT_TRUE(limiter.CanDraw({.inserted = 10, .sampled = 0, .size = 10}, 1));
  EXPECT_TRUE(limiter.CanInsert({.inserted = 9, .sampled = 0, .size = 9}));
}

TEST(RateLimiter, WithoutARatioNothingElseIsHeld) {
  const RateLimiter limiter = Make(0, 0, 1);
  EXPECT_TRUE(limiter.CanDraw({.inserted = 1, .sampled = 1000000000, .size = 1}, 1000));
  EXPECT_TRUE(limiter.CanInsert({.inserted = 1000000000, .sampled = 0, .size = 1}));
}

TEST(RateLimiter, HoldsInsertsThatRunAheadByMoreThanTheTolerance) {
  const RateLimiter limiter = Make(4, 40, 10);
  EXPECT_TRUE(limiter.CanInsert({.inserted = 20, .sampled = 0, .size = 20}));   // 4 * 10 - 0 = 40
  EXPECT_FALSE(limiter.CanInsert({.inserted = 21, .sampled = 0, .size = 21}));  // 44
  EXPECT_TRUE(limiter.CanInsert({.inserted = 21, .sampled = 4, .size = 21}));
}

TEST(RateLimiter, HoldsDrawsThatWouldRunAheadByMoreThanTheTolerance) {
  const RateLimiter limiter = Make(4, 40, 10);
  EXPECT_TRUE(limiter.CanDraw({.inserted = 10, .sampled = 0, .size = 10}, 40));
  EXPECT_FALSE(limiter.CanDraw({.inserted = 10, .sampled = 1, .size = 10}, 40));
  EXPECT_TRUE(limiter.CanDraw({.inserted = 11, .sampled = 1, .size = 11}, 40));
}

TEST(RateLimiter, NeverHoldsInsertsBelowTheMinimumSize) {
  // A store that was reopened may hold fewer than were inserted.
  const RateLimiter limiter = Make(4, 40, 10);
  EXPECT_TRUE(limiter.CanInsert({.inserted = 1000, .sampled = 0, .size = 9}));
}

TEST(RateLimiter, ADrawAboveTwiceTheToleranceRaisesIt) {
  RateLimiter limiter = Make(1, 10, 1);
  EXPECT_FALSE(limiter.MakeRoomFor(20));
  EXPECT_TRUE(limiter.MakeRoomFor(256));
  EXPECT_EQ(limiter.options().tolerance, 128);
  EXPECT_FALSE(limiter.MakeRoomFor(256));
}

TEST(RateLimiter, NeverHoldsInsertsAndDrawsAtOnce) {
  for (const double samples_per_insert : {0.01, 0.5, 1.0, 3.7, 100.0}) {
    for (const double tolerance : {0.0, 1.0, 100.0}) {
      for (const std::uint64_t draw : {1, 7, 256, 5000}) {
        RateLimiter limiter = Make(samples_per_insert, tolerance, 5);
        limiter.MakeRoomFor(draw);
        // Inserts as far as they may go, then draws as far as they may go, and so on.
        RateLimiter::Counts counts;
        for (int turn = 0; turn < 5; ++turn) {
          while (limiter.CanInsert(counts)) ++counts.inserted, ++counts.size;
          ASSERT_TRUE(limiter.CanDraw(counts, draw)) << limiter.WhyDrawWaits(counts, draw);
          while (limiter.CanDraw(counts, draw)) counts.sampled += draw;
          ASSERT_TRUE(limiter.CanInsert(counts)) << limiter.WhyInsertWaits(counts);
        }
      }
    }
  }
}

TEST(RateLimiter, SaysItsBoundsAndCounters) {
  const RateLimiter limiter = Make(4, 40, 10);
  EXPECT_THAT(limiter.WhyDrawWaits({.inserted = 3, .sampled = 0, .size = 3}, 8),
              AllOf(HasSubstr("min_size 10"), HasSubstr("inserted 3"), HasSubstr("7 more transitions")));
  EXPECT_THAT(limiter.WhyDrawWaits({.inserted = 12, .sampled = 45, .size = 12}, 8),
              AllOf(HasSubstr("samples_per_insert 4"), HasSubstr("tolerance 40"), HasSubstr("sampled 45"),
                    HasSubstr("= 45 is above the tolerance")));
  EXPECT_THAT(limiter.WhyInsertWaits({.inserted = 30, .sampled = 5, .size = 30}),
              AllOf(HasSubstr("inserted 30"), HasSubstr("= 75 is above the tolerance")));
}

TEST(RateLimiter, RefusesBoundsThatMakeNoSense) {
  EXPECT_THAT(RateLimiter::Make({-1, 0, 1}, 10).status().ToString(), HasSubstr("replay.samples_per_insert"));
  EXPECT_THAT(RateLimiter::Make({1, std::numeric_limits<double>::infinity(), 1}, 10).status().ToString(),
              HasSubstr("replay.tolerance"));
  EXPECT_THAT(RateLimiter::Make({1, 1, 0}, 10).status().ToString(), HasSubstr("replay.min_size"));
  EXPECT_THAT(RateLimiter::Make({1, 1, 11}, 10).status().ToString(),
              AllOf(HasSubstr("replay.min_size"), HasSubstr("10 transitions"), HasSubstr("found 11")));
}

TEST(RateLimiter, IsIdleWhileThereIsNothingButTheSeedBuffer) {
  const RateLimiter limiter = Make(4, 40, 10);
  EXPECT_TRUE(limiter.CanDraw({.inserted = 0, .sampled = 0, .size = 100, .seed_buffer = 100}, 1000000));
  EXPECT_TRUE(limiter.CanInsert({.inserted = 0, .sampled = 0, .size = 100, .seed_buffer = 100}));
  EXPECT_FALSE(limiter.CanDraw({.inserted = 0, .sampled = 0, .size = 9, .seed_buffer = 9}, 1))
      << "min_size holds";
}

TEST(RateLimiter, CountsOnlineRowsFromTheFirstWhereTheSeedHasTheMinimum) {
  const RateLimiter limiter = Make(4, 40, 10);
  EXPECT_TRUE(
      limiter.CanDraw({.inserted = 1, .sampled = 0, .size = 101, .seed_buffer = 100}, 44));  // 4 * 1 + 40
  EXPECT_FALSE(limiter.CanDraw({.inserted = 1, .sampled = 0, .size = 101, .seed_buffer = 100}, 45));
  EXPECT_TRUE(limiter.CanInsert({.inserted = 10, .sampled = 0, .size = 110, .seed_buffer = 100}));   // 40
  EXPECT_FALSE(limiter.CanInsert({.inserted = 11, .sampled = 0, .size = 111, .seed_buffer = 100}));  // 44
  // A seed buffer of 6 rows leaves 4 of the minimum to the others.
  EXPECT_TRUE(limiter.CanInsert({.inserted = 14, .sampled = 0, .size = 20, .seed_buffer = 6}));
  EXPECT_FALSE(limiter.CanInsert({.inserted = 15, .sampled = 0, .size = 21, .seed_buffer = 6}));
  EXPECT_THAT(limiter.WhyInsertWaits({.inserted = 15, .sampled = 0, .size = 21, .seed_buffer = 6}),
              AllOf(HasSubstr("seed buffer 6"), HasSubstr("(inserted - 4)")));
}

TEST(RateLimiter, CountsFromTheFirstTransitionsThatAreAskedFor) {
  RateLimiter limiter = Make(4, 40, 10);
  limiter.CountFrom(50);
  limiter.CountFrom(20);  // never less
  const auto counts = [](std::uint64_t inserted, std::uint64_t sampled) {
    return RateLimiter::Counts{
        .inserted = inserted, .sampled = sampled, .size = 100 + inserted, .seed_buffer = 100};
  };
  EXPECT_FALSE(limiter.CanDraw(counts(0, 0), 1)) << "free draws from the seed buffer are over";
  EXPECT_FALSE(limiter.CanDraw(counts(49, 0), 1));
  EXPECT_THAT(limiter.WhyDrawWaits(counts(49, 0), 1), HasSubstr("first 50 transitions"));
  EXPECT_TRUE(limiter.CanInsert(counts(49, 0))) << "nothing is owed for them";
  EXPECT_TRUE(limiter.CanDraw(counts(50, 0), 40));
  EXPECT_FALSE(limiter.CanDraw(counts(50, 0), 41));
  EXPECT_TRUE(limiter.CanInsert(counts(60, 0)));
  EXPECT_FALSE(limiter.CanInsert(counts(61, 0)));
}

}  // namespace
}  // namespace dbr
