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
  std::string address;  // of the replay server
  std::string name;     // for people: "actor-0"
  TransitionLayout layout;
  std::size_t batch_bytes = 32 << 10;                      // of one message
  int window = 16;                                         // unacknowledged messages under way, at most
  std::size_t buffered_transitions = 20000;                // not yet acknowledged; Append blocks past that
  absl::Duration max_batch_age = absl::Milliseconds(100);  // a message is sent at the latest after this
};

// Transitions so far, and streams that were opened after one was lost.
struct WriterCounters {
  std::uint64_t appended = 0;
  std::uint64_t acknowledged = 0;
  std::uint64_t refused = 0;  // non-finite, dropped by the server
  std::uint64_t reconnects = 0;
};

// Thread-safe, but the order of transitions is that of the calls of Append: one thread appends. A thread of
// the writer's own sends. Every transition gets the next sequence number of a writer id drawn at the start;
// after a broken stream all that is not acknowledged is sent again, and the server drops what it holds
// already. A loss of the server is logged once, and its return; retries back off with jitter up to 2 s.
class TransitionWriter {
 public:
  explicit TransitionWriter(WriterOptions options);
  ~TransitionWriter();  // Close(), dropping what is not acknowledged

  // Takes a transition with its first advantage, by a critic of that version, and the end of its episode
  // where it ended one. Copies it. Blocks while the writer's buffer is full (the rate limiter holds inserts,
  // or the server is away). Cancelled after Close; DeadlineExceeded after `timeout`; InvalidArgument where
  // widths differ from the layout or the server refuses the layout (final: every later call answers the
  // same).
  absl::Status Append(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                      const std::optional<EpisodeEnd>& end,
                      absl::Duration timeout = absl::InfiniteDuration());

  // Waits until all that was appended is acknowledged. DeadlineExceeded, Cancelled, or the final error.
  absl::Status Flush(absl::Duration timeout);

  void Close();  // from any thread; wakes blocked calls

  std::uint64_t id() const;  // never 0
  WriterCounters counters() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dbr
