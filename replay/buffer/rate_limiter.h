// The rate limiter: how many transitions may be drawn for each one that is inserted.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace dbr {

struct RateLimiterOptions {
  double samples_per_insert = 0;  // transitions drawn for each one inserted; 0: no limit
  double tolerance = 0;           // how far, in transitions drawn, the two may run apart
  std::uint64_t min_size = 1;     // nothing is drawn before the buffer holds this many
};

// With `lead` = samples_per_insert * (inserted - minimum) - sampled:
//   an insert waits while    lead > tolerance              (and the buffer has its minimum size),
//   a draw of n waits while  lead < n - tolerance          (or the buffer has not its minimum size).
// Both would wait for ever where tolerance < lead < n - tolerance, which needs n > 2 * tolerance: so a draw
// larger than that raises the tolerance to n / 2 for good, before it waits. Then one of the two can always go
// on.
//
// The rows of the seed buffer count as neither inserted nor sampled: `minimum` is min_size less their number,
// at least 0. While there are no others, draws are free and are not counted. CountFrom raises `minimum`, and
// no draw is made before it.
//
// Plain arithmetic without clock or lock. Thread-compatible: the buffer's mutex guards it.
class RateLimiter {
 public:
  // The counts of rows that it judges by, over the life of the buffer.
  struct Counts {
    std::uint64_t inserted = 0;     // without the seed buffer
    std::uint64_t sampled = 0;      // since the first row that is not of the seed buffer
    std::uint64_t size = 0;         // held now, the seed buffer's included
    std::uint64_t seed_buffer = 0;  // of the seed buffer, that ever came in
  };

  // InvalidArgument for negative or non-finite numbers and for a minimum size of 0 or above `capacity`.
  static absl::StatusOr<RateLimiter> Make(const RateLimiterOptions& options, std::uint64_t capacity);

  bool CanInsert(const Counts& counts) const;
  bool CanDraw(const Counts& counts, std::uint64_t n) const;

  // To be called before a draw of n waits. True where the tolerance was raised for it, to n / 2.
  bool MakeRoomFor(std::uint64_t n);

  // Counts from `first` inserted rows on, where that is more than before: a phase of which nothing is drawn.
  void CountFrom(std::uint64_t first) { first_ = std::max(first_, first); }

  // Sentences for people and errors: the limiter's bounds, its counters, and which bound holds the call.
  std::string WhyInsertWaits(const Counts& counts) const;
  std::string WhyDrawWaits(const Counts& counts, std::uint64_t n) const;

  const RateLimiterOptions& options() const { return options_; }

 private:
  explicit RateLimiter(const RateLimiterOptions& options) : options_(options) {}

  bool Offline(const Counts& counts) const {
    return counts.seed_buffer > 0 && counts.inserted == 0 && first_ == 0;
  }
  std::uint64_t Minimum(const Counts& counts) const;
  double Lead(const Counts& counts) const;
  std::string Describe(const Counts& counts) const;

  RateLimiterOptions options_;
  std::uint64_t first_ = 0;  // inserted rows before any draw
};

}  // namespace dbr
