// Batches drawn ahead of the updates.
#pragma once

#include <cstdint>
#include <memory>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/bounded_queue.h"
#include "replay/client/client.h"

namespace dbr {

struct PrefetcherOptions {
  DrawCounts counts;
  TransitionLayout layout;
  int depth = 2;                                         // batches ready ahead
  absl::Duration call_timeout = absl::Seconds(5);        // a Sample call that is held so long is made again
  absl::Duration retry_after = absl::Milliseconds(500);  // after a loss of the server
};

// Draws in a thread of its own until closed. A server that goes away, and its return, are logged once each;
// batches that the rate limiter holds back are waited for. An error that no other try mends (IsFinal,
// proto/rpc/grpc_status.h: widths that differ, for example) ends the drawing. Thread-safe.
class Prefetcher {
 public:
  // `client` outlives the prefetcher.
  Prefetcher(ReplayClient* client, const PrefetcherOptions& options);
  ~Prefetcher();  // Close() and join

  // The next batch; blocks until there is one. Cancelled after Close, or the final error.
  absl::StatusOr<std::unique_ptr<DrawnBatches>> Next();
  // Sets what later draws ask of the server. Batches that were drawn before it are dropped.
  void SetTerms(const DrawTerms& terms);
  // Gives a batch back, so that its memory is used again.
  void Recycle(std::unique_ptr<DrawnBatches> batches);
  // The share of Next() calls so far that had to wait, in [0, 1].
  double starved_share() const;

  void Close();  // from any thread; wakes Next

 private:
  // A batch, and how often the terms had been set when it was asked for.
  struct Drawn {
    std::unique_ptr<DrawnBatches> batches;
    std::uint64_t terms_set = 0;
  };

  void Run();
  // Whether to go on after a failed call; waits before the next attempt.
  bool HandleFailure(const absl::Status& status, bool* away);
  bool Closed() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return closed_; }

  ReplayClient* const client_;
  const PrefetcherOptions options_;
  BoundedQueue<Drawn> ready_;
  BoundedQueue<std::unique_ptr<DrawnBatches>> free_;
  mutable absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Status final_ ABSL_GUARDED_BY(mutex_);
  DrawTerms terms_ ABSL_GUARDED_BY(mutex_);
  std::uint64_t terms_set_ ABSL_GUARDED_BY(mutex_) = 0;
  std::uint64_t asked_ ABSL_GUARDED_BY(mutex_) = 0;
  std::uint64_t waited_ ABSL_GUARDED_BY(mutex_) = 0;
  std::thread thread_;
};

}  // namespace dbr
