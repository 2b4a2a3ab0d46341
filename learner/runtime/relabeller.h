// Advantages on their way back to the replay server.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#include "absl/types/span.h"
#include "core/bounded_queue.h"
#include "replay/client/client.h"

namespace dbr {

// Sends advantages in a thread of its own, so that an update never waits. What is offered while the queue is
// full, or cannot be sent, is dropped and counted: the transitions keep their older labels until they are
// drawn again. A failure to send is logged once until a call succeeds. Thread-safe.
class Relabeller {
 public:
  // `client` outlives the relabeller.
  explicit Relabeller(ReplayClient* client);
  ~Relabeller();  // Close() and join

  // Copies the advantages [one for each key] of the critic `critic_version` into the queue. Does not block.
  void Offer(std::uint64_t critic_version, absl::Span<const std::uint64_t> keys,
             absl::Span<const float> advantages);
  // Labels dropped so far.
  std::uint64_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

  void Close();  // from any thread; what is queued is dropped

 private:
  struct Labels {
    std::uint64_t critic_version;
    std::vector<std::uint64_t> keys;
    std::vector<float> advantages;
  };
  void Run();

  ReplayClient* const client_;
  BoundedQueue<Labels> queue_;
  std::atomic<std::uint64_t> dropped_{0};
  std::thread thread_;
};

}  // namespace dbr
