// How many events there are a second, over the last seconds.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "absl/time/time.h"

namespace dbr {

// Counts events in a ring of buckets, one for each second:
//
//   second   100  101  102  103  104     second 105 takes the bucket of 100
//   events    7    3    0    9    2
//
// Thread-compatible: the buffer's mutex guards it. Time comes from the caller and never goes back far.
class RateWindow {
 public:
  explicit RateWindow(absl::Time start) : start_(start) {}

  void Add(absl::Time now, std::uint64_t events) {
    const std::int64_t second = absl::ToUnixSeconds(now);
    Bucket& bucket = buckets_[static_cast<std::size_t>(second) % kBuckets];
    if (bucket.second != second) bucket = {second, 0};
    bucket.events += events;
  }

  // Events a second: the mean over the running second and the kBuckets - 1 before it, or over the time since
  // the start where that is shorter.
  double PerSecond(absl::Time now) const {
    const std::int64_t first = absl::ToUnixSeconds(now) - (kBuckets - 1);
    std::uint64_t events = 0;
    for (const Bucket& bucket : buckets_) {
      if (bucket.second >= first) events += bucket.events;
    }
    const double seconds = std::min(absl::ToDoubleSeconds(now - absl::FromUnixSeconds(first)),
                                    std::max(absl::ToDoubleSeconds(now - start_), 1e-3));
    return static_cast<double>(events) / seconds;
  }

 private:
  static constexpr int kBuckets = 5;
  struct Bucket {
    std::int64_t second = -1;
    std::uint64_t events = 0;
  };

  absl::Time start_;
  std::array<Bucket, kBuckets> buckets_;
};

}  // namespace dbr
