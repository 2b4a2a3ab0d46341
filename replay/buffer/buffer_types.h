// What goes into the buffer's calls and comes out of them.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "absl/types/span.h"
#include "core/transition.h"
#include "replay/buffer/columns.h"
#include "replay/buffer/partitions.h"
#include "replay/buffer/rate_limiter.h"

namespace dbr {

struct BufferOptions {
  RateLimiterOptions limiter;
  bool cumulative_advantage =
      false;  // a relabel with a gives max(A, 0) + a in place of a (A: the label before)
  // Share of the seed buffer in a draw from D, while D holds both; 0: as their sizes have it.
  double seed_buffer_share = 0;
  std::uint64_t seed = 1;
  std::function<absl::Time()> now = absl::Now;  // for rates and the uptime
};

struct RowEnd {
  int row = 0;
  EpisodeEnd end;
};

// Transitions first_sequence, first_sequence + 1, ... of one writer.
struct InsertBatch {
  std::uint64_t first_sequence = 1;
  InsertColumns columns;
  absl::Span<const RowEnd> ends;  // by ascending row
  int next_row = 0;               // how far Insert came; a second call goes on there
};

// How far the buffer holds a writer's sequence.
struct WriterProgress {
  std::uint64_t last_sequence = 0;
  std::uint64_t refused = 0;
};

struct DrawRequest {
  std::array<std::uint32_t, kDrawnParts> counts{};  // from D, D+, D-
  bool allow_empty_partitions = false;  // an empty partition gives nothing; else the draw waits for it
};

using DrawBuffers = std::array<DrawColumns, kDrawnParts>;  // with room for the asked counts

struct DrawResult {
  std::array<std::uint32_t, kDrawnParts> drawn{};  // the asked count, or 0 of an empty partition
  std::uint64_t total = 0, plus = 0, minus = 0, unjudged = 0;
  std::uint64_t inserted = 0, episodes = 0;  // without the seed buffer
  double raised_tolerance = 0;  // other than 0 where the limiter's tolerance had to be raised for this draw
};

struct RelabelResult {
  std::uint64_t relabelled = 0, evicted = 0, stale = 0, refused = 0;
};

}  // namespace dbr
