// The transitions of a writer from their coming until their acknowledgement, as messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "absl/time/time.h"
#include "core/transition.h"
#include "proto/replay.pb.h"

namespace dbr {

struct OutboxOptions {
  TransitionLayout layout;
  std::size_t rows_per_message = 1;
  std::size_t window = 1;  // messages under way
  absl::Duration
      max_batch_age;  // when a message goes out that is not full, or an acknowledgement is asked for
};

// A message is filled by Append, sealed when it is full, or when it is old or waited for and nothing else is
// to be sent; it is sent, and dropped when it is acknowledged:
//   filling_  ->  sealed_[sent_ ...]  ->  sealed_[0 ... sent_)  ->  gone.
// A quarter of a window apart, and with each message that was sealed early, an acknowledgement is asked for;
// so one is always under way while the window is full. Thread-compatible: the writer's lock guards it; time
// comes from the caller.
class Outbox {
 public:
  explicit Outbox(const OutboxOptions& options);

  void Append(const TransitionView& transition, float advantage, std::uint64_t critic_version,
              const std::optional<EpisodeEnd>& end, absl::Time now);

  // When Next has something: at once, at the time when what there is will be old, or never. `waited_for`:
  // somebody waits for room or for the last acknowledgement.
  absl::Time NextTime(bool waited_for) const;
  // The next message to send, or null where NextTime is later than `now`. It must not be changed; it may come
  // again on another stream.
  std::shared_ptr<const InsertRequest> Next(absl::Time now, bool waited_for);

  void Acknowledge(const InsertReply& reply);
  // Begins anew with all that is not acknowledged, for another stream.
  void Restart();

  std::uint64_t appended() const { return appended_; }
  std::uint64_t acknowledged() const { return acknowledged_; }
  std::uint64_t refused() const { return refused_; }

 private:
  bool WindowOpen() const { return sent_ < options_.window; }
  bool CanSend() const { return WindowOpen() && sent_ < sealed_.size(); }
  void StartMessage(absl::Time now);
  std::shared_ptr<const InsertRequest> Send(bool early, absl::Time now);

  const OutboxOptions options_;
  const std::size_t messages_per_acknowledgement_;
  std::shared_ptr<InsertRequest> filling_;
  absl::Time filling_since_;
  std::deque<std::shared_ptr<InsertRequest>> sealed_;  // not acknowledged, in order
  std::vector<std::shared_ptr<InsertRequest>> spare_;  // to be filled again
  std::size_t sent_ = 0;                               // of sealed_, on this stream
  std::size_t sent_unasked_ = 0;                       // since the last that asks for an acknowledgement
  absl::Time last_sent_;
  std::uint64_t appended_ = 0;
  std::uint64_t acknowledged_ = 0;
  std::uint64_t refused_ = 0;
};

}  // namespace dbr
