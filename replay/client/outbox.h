// The messages of a writer, from when a transition is appended until it is acknowledged.
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
  std::size_t window = 1;  // messages under way, at most
  // After this a message goes out that is not full, or an acknowledgement is asked for.
  absl::Duration max_batch_age;
};

// Append fills a message. It is sealed when it is full, or when it is old or waited for and nothing else is
// to be sent. Next sends it, and when it is acknowledged its memory is used for another one:
//
//      Append               Next                      Acknowledge
//   spare_ -> filling_  ->  sealed_[sent_ ..)     ->  sealed_[0 .. sent_)           ->  spare_
//             | 48 .. |     | 47 | 46 |               | 45 | 44 | 43 | 42 | 41 |
//             not full      waits to be sent          under way: at most a window
//
// Every quarter of a window, and each message that was sealed early, asks for an acknowledgement (?), so that
// one is always under way while the window is full. It takes all messages up to its sequence number. With a
// window of 8:
//
//   sent       41   42?  43   44?  45   46?  47   48?       the window is full
//   acknowledged up to 42:
//   sent                 43   44?  45   46?  47   48?  49   50?
//
// After a broken stream Restart sets sent_ to 0: all that are sealed are sent again, and the server drops
// what it holds. Thread-compatible: the writer's mutex guards it; time comes from the caller.
class Outbox {
 public:
  explicit Outbox(const OutboxOptions& options);

  // Copies a transition, with the end of its episode where it ended one. Has no bound of its own: the writer
  // appends while appended() - acknowledged() is below its own.
  void Append(const TransitionView& transition, float advantage, std::uint64_t critic_version,
              const std::optional<EpisodeEnd>& end, absl::Time now);

  // The time from which Next has a message: the past where it has one now, the time when what there is will
  // be old, or the infinite future. `waited_for`: somebody waits for room or for the last acknowledgement.
  absl::Time NextTime(bool waited_for) const;
  // The next message to send, or null where NextTime is later than `now`. The outbox lends it: it stays as it
  // is until GiveBack, also where it is acknowledged before, and may come again on another stream. Requires
  // that the message before was given back. A message without transitions asks for an acknowledgement alone.
  const InsertRequest* Next(absl::Time now, bool waited_for);
  // Gives back what Next has lent; does nothing where it has lent nothing. From then on the memory of an
  // acknowledged message may hold another one.
  void GiveBack();

  // Takes the server's word that it holds all up to a sequence number.
  void Acknowledge(const InsertReply& reply);
  // Begins anew with all that is not acknowledged, for another stream.
  void Restart();

  // Transitions so far: appended, acknowledged, and of these refused for good by the server.
  std::uint64_t appended() const { return appended_; }
  std::uint64_t acknowledged() const { return acknowledged_; }
  std::uint64_t refused() const { return refused_; }

 private:
  bool WindowOpen() const { return sent_ < options_.window; }
  bool CanSend() const { return WindowOpen() && sent_ < sealed_.size(); }
  void StartMessage(absl::Time now);
  const InsertRequest* Send(bool early, absl::Time now);

  const OutboxOptions options_;
  const std::size_t messages_per_acknowledgement_;
  std::unique_ptr<InsertRequest> filling_;  // null before its first transition
  absl::Time filling_since_;
  std::deque<std::unique_ptr<InsertRequest>> sealed_;  // not acknowledged, in order
  std::vector<std::unique_ptr<InsertRequest>> spare_;  // to be filled again
  const InsertRequest* lent_ = nullptr;                // in sealed_, lent_acknowledged_ or question_
  std::unique_ptr<InsertRequest> lent_acknowledged_;   // null, or what is lent and no longer in sealed_
  InsertRequest question_;                             // asks for an acknowledgement alone
  std::size_t sent_ = 0;                               // how many of sealed_ are sent on this stream
  std::size_t sent_unasked_ = 0;                       // how many since one that asks for acknowledgement
  absl::Time last_sent_;
  std::uint64_t appended_ = 0;
  std::uint64_t acknowledged_ = 0;
  std::uint64_t refused_ = 0;
};

}  // namespace dbr
