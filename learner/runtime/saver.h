// Checkpoints and the policy file, written beside training.
#pragma once

#include <cstdint>
#include <string>
#include <thread>
#include <variant>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "core/bounded_queue.h"
#include "core/policy_snapshot.h"
#include "core/run_folder.h"
#include "learner/runtime/checkpoints.h"

namespace dbr {

// The learner's state after `updates` updates.
struct Checkpoint {
  std::uint64_t updates = 0;
  TensorFile state;       // what Trainer::Load takes
  PolicySnapshot policy;  // what actors and evaluators act by
};

// Writes checkpoints in a thread of its own: checkpoints/UPDATES.safetensors and policy/latest.safetensors
// (docs/formats.md). An error (a full disk) is logged and what stood there before stays; training goes on.
// Thread-safe.
class Saver {
 public:
  // Keeps the newest `keep` checkpoints. Creates the folder of the policy.
  Saver(const RunFolder& folder, int keep);
  ~Saver();  // finishes the write under way and joins

  // Does not block; false, and nothing is written, where the one offered before still waits its turn.
  bool Offer(Checkpoint checkpoint);
  // Has `policy` written as policy/UPDATES.safetensors, which stays. Blocks while others wait their turn.
  void KeepPolicy(PolicySnapshot policy);
  // Writes now, after what is under way, in the calling thread. A checkpoint older than one that is written
  // already is left out, so that one offered earlier which still waits does not take its place. Errors are
  // those of SaveTensors (core/safetensors.h).
  absl::Status SaveNow(const Checkpoint& checkpoint);

 private:
  // What is to be written: a checkpoint, or a policy that is kept.
  using Work = std::variant<Checkpoint, PolicySnapshot>;

  void Run();
  absl::Status Write(const Work& work);

  const RunFolder folder_;
  absl::Mutex writing_;  // held while files are written, by either thread
  Checkpoints checkpoints_ ABSL_GUARDED_BY(writing_);
  std::uint64_t written_ ABSL_GUARDED_BY(writing_) = 0;  // the updates of the newest one on disk
  BoundedQueue<Work> queue_;
  std::thread thread_;
};

}  // namespace dbr
