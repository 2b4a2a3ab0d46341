// Checkpoints and the policy file, written beside training.
#pragma once

#include <cstdint>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "core/bounded_queue.h"
#include "core/policy_snapshot.h"
#include "core/run_folder.h"
#include "learner/runtime/checkpoints.h"

namespace dbr {

// One state of the learner.
struct Checkpoint {
  std::uint64_t updates = 0;
  TensorFile state;
  PolicySnapshot policy;
};

// Writes in a thread of its own: checkpoints/UPDATES.safetensors and policy/latest.safetensors. An error (a
// full disk) is logged and what stood there before stays; training goes on.
class Saver {
 public:
  Saver(const RunFolder& folder, int keep);
  ~Saver();  // finishes the write under way and joins

  // Does not block; false, and nothing is written, where the one offered before still waits its turn.
  bool Offer(Checkpoint checkpoint);
  // Writes now, after what is under way, in the calling thread; what was offered earlier and waits is written
  // no more.
  absl::Status SaveNow(const Checkpoint& checkpoint);

 private:
  void Run();

  const RunFolder folder_;
  absl::Mutex writing_;
  Checkpoints checkpoints_ ABSL_GUARDED_BY(writing_);
  std::uint64_t written_ ABSL_GUARDED_BY(writing_) = 0;  // the updates of the newest one on disk
  BoundedQueue<Checkpoint> queue_;
  std::thread thread_;
};

}  // namespace dbr
