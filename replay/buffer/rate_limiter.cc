#include "replay/buffer/rate_limiter.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace dbr {
namespace {

absl::Status CheckNotNegative(const char* field, double value) {
  if (std::isfinite(value) && value >= 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("replay.", field, ": expected a number of at least 0, found ", value));
}

}  // namespace

absl::StatusOr<RateLimiter> RateLimiter::Make(const RateLimiterOptions& options, std::uint64_t capacity) {
  if (absl::Status s = CheckNotNegative("samples_per_insert", options.samples_per_insert); !s.ok()) return s;
  if (absl::Status s = CheckNotNegative("tolerance", options.tolerance); !s.ok()) return s;
  if (options.min_size < 1 || options.min_size > capacity) {
    return absl::InvalidArgumentError(
        absl::StrCat("replay.min_size: expected 1 to the ", capacity,
                     " transitions that the buffer can hold (replay.capacity and replay.byte_budget), found ",
                     options.min_size));
  }
  return RateLimiter(options);
}

std::uint64_t RateLimiter::Minimum(const Counts& counts) const {
  return std::max(options_.min_size - std::min(options_.min_size, counts.seed_buffer), first_);
}

double RateLimiter::Lead(const Counts& counts) const {
  const double after_minimum = static_cast<double>(counts.inserted) - static_cast<double>(Minimum(counts));
  return options_.samples_per_insert * after_minimum - static_cast<double>(counts.sampled);
}

bool RateLimiter::CanInsert(const Counts& counts) const {
  if (options_.samples_per_insert == 0 || counts.size < options_.min_size) return true;
  return Lead(counts) <= options_.tolerance;
}

bool RateLimiter::CanDraw(const Counts& counts, std::uint64_t n) const {
  if (counts.size < options_.min_size || counts.inserted < first_) return false;
  if (options_.samples_per_insert == 0 || Offline(counts)) return true;
  return static_cast<double>(n) - Lead(counts) <= options_.tolerance;
}

bool RateLimiter::MakeRoomFor(std::uint64_t n) {
  if (options_.samples_per_insert == 0 || static_cast<double>(n) <= 2 * options_.tolerance) return false;
  options_.tolerance = static_cast<double>(n) / 2;
  return true;
}

std::string RateLimiter::Describe(const Counts& counts) const {
  return absl::StrCat(
      "rate limiter (samples_per_insert ", options_.samples_per_insert, ", tolerance ", options_.tolerance,
      ", min_size ", options_.min_size, ") with inserted ", counts.inserted, ", sampled ", counts.sampled,
      ", size ", counts.size,
      counts.seed_buffer > 0 ? absl::StrCat(", seed buffer ", counts.seed_buffer, " (counted apart)") : "");
}

std::string RateLimiter::WhyInsertWaits(const Counts& counts) const {
  return absl::StrCat(Describe(counts), ": inserts wait while samples_per_insert * (inserted - ",
                      Minimum(counts), ") - sampled = ", Lead(counts),
                      " is above the tolerance; they go on when more is drawn");
}

std::string RateLimiter::WhyDrawWaits(const Counts& counts, std::uint64_t n) const {
  if (counts.inserted < first_) {
    return absl::StrCat(Describe(counts), ": draws wait for the first ", first_,
                        " transitions beside the seed buffer; ", first_ - counts.inserted,
                        " more are needed");
  }
  if (counts.size < options_.min_size) {
    return absl::StrCat(Describe(counts), ": draws wait for min_size; ", options_.min_size - counts.size,
                        " more transitions are needed");
  }
  return absl::StrCat(Describe(counts), ": a draw of ", n, " waits while sampled + ", n,
                      " - samples_per_insert * (inserted - ", Minimum(counts),
                      ") = ", static_cast<double>(n) - Lead(counts),
                      " is above the tolerance; it goes on when more is inserted");
}

}  // namespace dbr
