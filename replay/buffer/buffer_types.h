// The arguments and results of the replay buffer's calls, as plain values.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "absl/time/time.h"
#include "absl/types/span.h"
#include "core/transition.h"
#include "replay/buffer/columns.h"
#include "replay/buffer/partitions.h"
#include "replay/buffer/rate_limiter.h"

namespace dbr {

// The share of the seed buffer's rows in a draw from D, D+ or D-, while the part holds rows of both kinds.
struct SeedBufferShare {
  double first = 0;              // 0 without `decay_rows`: as the numbers of rows in the part have it
  double final = 0;              // after decay_rows rows beside the seed buffer have been inserted
  std::uint64_t decay_rows = 0;  // over which it moves linearly from `first` to `final`; 0: it stays

  bool follows_sizes() const { return first == 0 && decay_rows == 0; }
  // The share once `inserted` rows beside the seed buffer have been inserted.
  double At(std::uint64_t inserted) const {
    if (decay_rows == 0) return first;
    const double done = static_cast<double>(std::min(inserted, decay_rows)) / static_cast<double>(decay_rows);
    return first + done * (final - first);
  }
};

struct BufferOptions {
  RateLimiterOptions limiter;
  // A relabel with `a` gives max(A, 0) + a in place of a, where A is the label before.
  bool cumulative_advantage = false;
  // D- holds the rows with an advantage of -minus_margin or less.
  double minus_margin = 0;
  SeedBufferShare seed_buffer_share;
  std::uint64_t seed = 1;                       // of the random numbers
  std::function<absl::Time()> now = absl::Now;  // for rates and the uptime
};

// An episode that ended with a row of an InsertBatch.
struct RowEnd {
  int row = 0;  // from 0
  EpisodeEnd end;
};

// Transitions of one writer with the sequence numbers first_sequence, first_sequence + 1, ...; views into
// memory that the caller owns.
struct InsertBatch {
  std::uint64_t first_sequence = 1;
  InsertColumns columns;
  absl::Span<const RowEnd> ends;  // by ascending row
  int next_row = 0;               // the first row that Insert has not dealt with; the next call goes on there
};

// How far the buffer holds a writer's sequence.
struct WriterProgress {
  std::uint64_t last_sequence = 0;  // all rows up to this one are stored, or were refused for good
  std::uint64_t refused = 0;        // rows of the writer that were refused, in all
};

struct DrawRequest {
  std::array<std::uint32_t, kDrawnParts> counts{};  // rows from D, D+, D-
  bool allow_empty_partitions = false;      // an empty partition gives no rows; else the draw waits for one
  std::optional<double> seed_buffer_share;  // in place of the options'; 0 draws none where there are others
  std::uint64_t first_transitions = 0;      // waits until so many beside the seed buffer have been inserted
};

// Room for the asked counts from D, D+ and D-; the caller owns the memory.
using DrawBuffers = std::array<DrawColumns, kDrawnParts>;

struct DrawResult {
  std::array<std::uint32_t, kDrawnParts> drawn{};  // the asked count, or 0 from an empty partition
  std::uint64_t total = 0, plus = 0, minus = 0, unjudged = 0;  // rows held when the draw was made
  std::uint64_t inserted = 0, episodes = 0;                    // without the seed buffer
  double raised_tolerance =
      0;  // the limiter's new tolerance, where it had to be raised for this draw; else 0
};

// What became of the keys of a relabel.
struct RelabelResult {
  std::uint64_t relabelled = 0;
  std::uint64_t evicted = 0;  // no longer held
  std::uint64_t stale = 0;    // have a label of a newer critic already
  std::uint64_t refused = 0;  // were given an advantage that is not finite
};

}  // namespace dbr
