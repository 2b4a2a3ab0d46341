#include "replay/service/latency_histogram.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace dbr {
namespace {

std::int64_t SteadyNanoseconds() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

constexpr double kBucketsPerDoubling = 4;

}  // namespace

void LatencyHistogram::Record(absl::Duration duration) {
  constexpr double kLongest = 4e9;  // microseconds; of the last bucket
  const double us = std::clamp(absl::ToDoubleMicroseconds(duration), 1.0, kLongest);
  const int bucket = std::min(static_cast<int>(std::log2(us) * kBucketsPerDoubling), kBuckets - 1);
  buckets_[static_cast<std::size_t>(bucket)].fetch_add(1, std::memory_order_relaxed);
}

std::uint64_t LatencyHistogram::count() const {
  std::uint64_t total = 0;
  for (const auto& bucket : buckets_) total += bucket.load(std::memory_order_relaxed);
  return total;
}

double LatencyHistogram::QuantileMicroseconds(double q) const {
  const double rank = q * static_cast<double>(count());
  double below = 0;
  for (int i = 0; i < kBuckets; ++i) {
    const double here =
        static_cast<double>(buckets_[static_cast<std::size_t>(i)].load(std::memory_order_relaxed));
    // The bucket's middle on the logarithmic scale.
    if (here > 0 && below + here >= rank) return std::exp2((i + 0.5) / kBucketsPerDoubling);
    below += here;
  }
  return 0;
}

LatencyTimer::LatencyTimer(LatencyHistogram* histogram)
    : histogram_(histogram), start_ns_(SteadyNanoseconds()) {}

LatencyTimer::~LatencyTimer() {
  histogram_->Record(absl::Nanoseconds(SteadyNanoseconds() - start_ns_));
}

}  // namespace dbr
