// A histogram of how long calls take.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "absl/time/time.h"

namespace dbr {

// Counts durations in buckets that grow by a quarter of a power of two, 1 us and below to 70 minutes.
// Thread-safe without a lock; a quantile read while others record may miss them.
class LatencyHistogram {
 public:
  void Record(absl::Duration duration);

  std::uint64_t count() const;
  // The duration in microseconds below which a share `q` (0 to 1) of the calls stayed, within a fifth; 0
  // without calls.
  double QuantileMicroseconds(double q) const;

 private:
  static constexpr int kBuckets = 128;
  std::array<std::atomic<std::uint64_t>, kBuckets> buckets_{};
};

// Records the time from its construction to its destruction. `histogram` is not owned and outlives it.
class LatencyTimer {
 public:
  explicit LatencyTimer(LatencyHistogram* histogram);
  ~LatencyTimer();
  LatencyTimer(const LatencyTimer&) = delete;
  LatencyTimer& operator=(const LatencyTimer&) = delete;

 private:
  LatencyHistogram* const histogram_;
  const std::int64_t start_ns_;
};

}  // namespace dbr
