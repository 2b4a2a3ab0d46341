// Which inserts and draws of the replay buffer may go on now, and how the others wait.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "replay/buffer/buffer_stats.h"
#include "replay/buffer/buffer_types.h"
#include "replay/buffer/partitions.h"
#include "replay/buffer/rate_limiter.h"
#include "replay/store/transition_store.h"

namespace dbr {

// What the rate limiter judges a buffer by. The rows of the seed buffer count apart. O(1).
RateLimiter::Counts CountsOf(const TransitionStore& store);

// Admits calls by the rate limiter and by what the partitions hold, and knows who waits:
//
//   AwaitInsert --- the limiter lets rows in, or a draw waits for an empty partition -----> goes on
//   AwaitDraw ----- the limiter lets n draws out, and the partitions asked have rows -----> goes on
//                   the deadline passes -------> DeadlineExceeded, which says what it waited for
//                   Close is called -----------> Unavailable
//
// A draw that waits for an empty partition can only be helped by an insert or a relabel, and the process that
// draws may be the one that relabels; so inserts pass the limiter meanwhile.
//
// Has no lock of its own. Thread-compatible: the buffer's mutex guards it, with the store and the partitions
// that it looks at; a waiting call gives that mutex up, and looks again when another one releases it.
class Admission {
 public:
  // `store` and `partitions` are not owned and outlive this.
  Admission(const RateLimiter& limiter, const TransitionStore* store, const Partitions* partitions);

  // Whether an insert of one row would go on at once. O(1).
  bool CanInsert() const;
  // Blocks until a row may be inserted. Errors: DeadlineExceeded, Unavailable.
  absl::Status AwaitInsert(absl::Mutex* mutex, absl::Time deadline) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // Blocks until `request` may be drawn. Errors: DeadlineExceeded, Unavailable.
  absl::Status AwaitDraw(absl::Mutex* mutex, const DrawRequest& request, absl::Time deadline)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  // To be called before a draw waits (RateLimiter::CountFrom).
  void CountFrom(std::uint64_t first) { limiter_.CountFrom(first); }
  // To be called before a draw of `draws` rows waits (RateLimiter::MakeRoomFor). Returns the tolerance where
  // it had to be raised, else 0.
  double MakeRoomFor(std::uint64_t draws);

  // Ends all waits and refuses later ones, from when the mutex is released.
  void Close() { closed_ = true; }
  // Unavailable after Close.
  absl::Status CheckOpen() const;

  // The calls that wait and could not go on now, inserts before draws, with the reason of the newest draw.
  std::vector<BlockedCalls> Blocked() const;

 private:
  struct Waiting {
    std::uint64_t inserts = 0, draws = 0;
    std::uint64_t draws_of_plus = 0, draws_of_minus = 0;  // of these, those that need a row of D+ or D-
    DrawRequest newest_draw;
  };

  bool CanDraw(const DrawRequest& request) const;
  // The rows that `request` would draw now.
  std::uint64_t EffectiveDraws(const DrawRequest& request) const;
  std::string WhyInsertWaits() const { return limiter_.WhyInsertWaits(CountsOf(store_)); }
  std::string WhyDrawWaits(const DrawRequest& request) const;

  RateLimiter limiter_;
  const TransitionStore& store_;
  const Partitions& partitions_;
  Waiting waiting_;
  bool closed_ = false;
};

}  // namespace dbr
