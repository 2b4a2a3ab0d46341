// The way into the replay server: a bounded, resumable stream of transitions.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "core/transition.h"

namespace dbr {

struct WriterOptions {
  std::string address;                       // of the replay server: "unix:/path" or "host:port"
  std::string name;                          // for people, 1 to 63 bytes: "actor-0"
  TransitionLayout layout;                   // of every transition
  std::size_t batch_bytes = 32 << 10;        // of one message's transitions, about
  int window = 16;                           // unacknowledged messages under way
  std::size_t buffered_transitions = 20000;  // not yet acknowledged; Append blocks past that
  absl::Duration max_batch_age = absl::Milliseconds(100);  // a message is sent at the latest after this
};

// Transitions since the start of the writer, and streams.
struct WriterCounters {
  std::uint64_t appended = 0;
  std::uint64_t acknowledged = 0;  // stored by the server, or refused by it for good
  std::uint64_t refused = 0;       // with values that are not finite, dropped by the server
  std::uint64_t reconnects = 0;    // streams opened after a loss
};

// Append is for one thread, the other functions for any; a thread of the writer's own sends. Every transition
// gets the next sequence number of a writer id drawn at the start; after a broken stream all that is not
// acknowledged is sent again and the server drops what it holds already. A loss of the server is logged once,
// and its return; retries back off with jitter up to 2 s. An error that no retry mends (IsFinal,
// proto/rpc/grpc_status.h: another layout, another protocol version, another program at the address) is
// logged, ends the sending, and is what every later call returns.
class TransitionWriter {
 public:
  explicit TransitionWriter(WriterOptions options);
  ~TransitionWriter();  // Close(), dropping what is not acknowledged

  // Copies a transition into the buffer. Blocks while the buffer is full (the rate limiter holds inserts, or
  // the server is away). `advantage` may be kUnjudged, else it is that of the critic `critic_version`; `end`
  // is set for the transition that ended an episode. Cancelled after Close; DeadlineExceeded after `timeout`;
  // InvalidArgument where widths differ from the layout; the final error.
  absl::Status Append(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                      const std::optional<EpisodeEnd>& end,
                      absl::Duration timeout = absl::InfiniteDuration());

  // Waits until all that was appended is acknowledged. DeadlineExceeded, Cancelled, or the final error.
  absl::Status Flush(absl::Duration timeout);

  void Close();  // from any thread; wakes blocked calls

  std::uint64_t id() const;  // unique for each writer, never 0
  WriterCounters counters() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dbr
