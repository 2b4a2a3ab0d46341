// Typed calls to the replay server for everything but inserting (replay/client/writer.h).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "absl/types/span.h"
#include "core/batch.h"
#include "proto/replay.pb.h"

namespace dbr {

// How many transitions to draw.
struct DrawCounts {
  int uniform = 0;  // from D
  int plus = 0;     // from D+
  int minus = 0;    // from D-
};

// The result of one Sample call. The caller owns it and has it refilled.
struct DrawnBatches {
  Batch uniform;
  Batch plus;   // size 0 where D+ was empty
  Batch minus;  // size 0 where D- was empty
  // Rows in D, in D+, in D- and not yet judged when the draw was made.
  std::uint64_t total_size = 0, plus_size = 0, minus_size = 0, unjudged_size = 0;
  std::uint64_t inserted = 0, episodes = 0;  // so far, without the seed buffer's
};

// Thread-safe. Calls block until their timeout. Errors carry the server's message: Unavailable where there is
// no server, DeadlineExceeded where the rate limiter held the call (its counters and bounds are in the
// message), Cancelled after Close.
class ReplayClient {
 public:
  explicit ReplayClient(const std::string& address);

  // Draws transitions that lie as `layout` says into `out`, with their keys. Empty partitions give batches of
  // size 0. InvalidArgument where the server has another layout.
  absl::Status Sample(const DrawCounts& counts, const TransitionLayout& layout, absl::Duration timeout,
                      DrawnBatches* out);
  // Sets the advantages of the rows `keys` [n], given by a critic of `critic_version`.
  absl::StatusOr<RelabelReply> Relabel(std::uint64_t critic_version, absl::Span<const std::uint64_t> keys,
                                       absl::Span<const float> advantages, absl::Duration timeout);
  absl::StatusOr<StatsReply> Stats(absl::Duration timeout);

  // Cancels the calls under way and fails later ones with Cancelled.
  void Close();

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace dbr
