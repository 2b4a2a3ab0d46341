// Typed calls to the replay server for everything but inserting (replay/client/writer.h).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "absl/types/span.h"
#include "core/batch.h"
#include "proto/replay.pb.h"

namespace dbr {

// How many transitions to draw, with replacement.
struct DrawCounts {
  int uniform = 0;  // from D, all transitions
  int plus = 0;     // from D+
  int minus = 0;    // from D-
};

// What a draw asks of the server beside the counts.
struct DrawTerms {
  std::optional<double> seed_buffer_share;  // in place of the server's; 0 draws none where there are others
  std::uint64_t first_transitions = 0;      // waits until so many beside the seed buffer have come in
};

// The result of one Sample call. The caller owns it and has it refilled.
struct DrawnBatches {
  Batch uniform;
  Batch plus;   // size 0 where D+ was empty
  Batch minus;  // size 0 where D- was empty
  // Transitions in D, in D+, in D- and not yet judged at the time of the draw.
  std::uint64_t total_size = 0, plus_size = 0, minus_size = 0, unjudged_size = 0;
  std::uint64_t inserted = 0;  // transitions so far, without the seed buffer
  std::uint64_t episodes = 0;  // that have ended so far
};

// A connection to one replay server. Thread-safe; calls block until their timeout. Errors carry the server's
// message. Common to all calls: Unavailable where there is no server, DeadlineExceeded where it did not
// answer in time, Unimplemented where another program listens at the address, Cancelled after Close. IsFinal
// (proto/rpc/grpc_status.h) tells which of them another call may mend.
class ReplayClient {
 public:
  // Connects in the background: an address where nobody listens is an error of the calls.
  explicit ReplayClient(const std::string& address);

  // Draws into `out`, all counts under one snapshot. An empty D+ or D- gives an empty batch; D must have
  // something. DeadlineExceeded also where the rate limiter held the call (its counters and bounds are in the
  // message); InvalidArgument where the server's transitions are not of `layout`, naming the width, and where
  // the counts are 0 or ask for more than one message holds.
  absl::Status Sample(const DrawCounts& counts, const TransitionLayout& layout, absl::Duration timeout,
                      DrawnBatches* out, const DrawTerms& terms = {});
  // Writes `advantages` [one for each key] of the critic `critic_version` to the transitions; the reply
  // counts what was taken. InvalidArgument where the lengths differ.
  absl::StatusOr<RelabelReply> Relabel(std::uint64_t critic_version, absl::Span<const std::uint64_t> keys,
                                       absl::Span<const float> advantages, absl::Duration timeout);
  // FailedPrecondition where the server speaks another protocol version (proto/rpc/protocol.h).
  absl::StatusOr<StatsReply> Stats(absl::Duration timeout);

  // Cancels the calls under way and fails later ones with Cancelled.
  void Close();

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace dbr
