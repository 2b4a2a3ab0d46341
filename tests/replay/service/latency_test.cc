#include <gtest/gtest.h>

#include "replay/buffer/rate_window.h"
#include "replay/service/latency_histogram.h"

namespace dbr {
namespace {

TEST(LatencyHistogram, TellsQuantilesWithinAFifth) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.QuantileMicroseconds(0.5), 0);
  for (int us = 1; us <= 1000; ++us) histogram.Record(absl::Microseconds(us));
  EXPECT_EQ(histogram.count(), 1000u);
  EXPECT_NEAR(histogram.QuantileMicroseconds(0.5), 500, 100);
  EXPECT_NEAR(histogram.QuantileMicroseconds(0.99), 990, 198);
}

TEST(LatencyHistogram, TakesAnyDuration) {
  LatencyHistogram histogram;
  histogram.Record(-absl::Seconds(1));
  histogram.Record(absl::ZeroDuration());
  histogram.Record(absl::Hours(1000));
  histogram.Record(absl::InfiniteDuration());
  EXPECT_EQ(histogram.count(), 4u);
  EXPECT_LT(histogram.QuantileMicroseconds(0.25), 2);
  EXPECT_GT(histogram.QuantileMicroseconds(0.99), 1e9);
}

TEST(RateWindow, ForgetsWhatIsOlderThanItsSeconds) {
  const absl::Time start = absl::FromUnixSeconds(100);
  RateWindow window(start);
  EXPECT_EQ(window.PerSecond(start), 0);
  window.Add(start, 30);
  EXPECT_DOUBLE_EQ(window.PerSecond(start + absl::Seconds(3)), 10);
  window.Add(start + absl::Seconds(3), 30);
  EXPECT_DOUBLE_EQ(window.PerSecond(start + absl::Seconds(4)), 15);
  EXPECT_DOUBLE_EQ(window.PerSecond(start + absl::Seconds(5)), 7.5);  // the first second is out: 30 in 4 s
  EXPECT_DOUBLE_EQ(window.PerSecond(start + absl::Seconds(50)), 0);
}

}  // namespace
}  // namespace dbr
