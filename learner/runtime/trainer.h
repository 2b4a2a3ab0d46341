// The learner's main loop: draw, update, write advantages back, push the policy, save.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/run_folder.h"
#include "learner/algorithm.h"
#include "learner/metrics/metrics_sink.h"
#include "learner/runtime/finetune.h"
#include "learner/runtime/prefetcher.h"
#include "learner/runtime/relabeller.h"
#include "learner/runtime/saver.h"
#include "proto/config.pb.h"

namespace dbr {

class PolicyService;

// What a trainer works with. The four pointers are not owned and outlive the trainer.
struct TrainerParts {
  std::unique_ptr<Algorithm> algorithm;
  std::string matrix_products;  // what makes them, for people (nn/product/product_library.h)
  PolicyService* policy_service = nullptr;
  MetricsSink* metrics = nullptr;
  Saver* saver = nullptr;
  std::unique_ptr<Prefetcher> prefetcher;
  std::unique_ptr<Relabeller> relabeller;
  Finetune* finetune = nullptr;
};

// Load, StartVersionsAfter and Run are for one thread, in this order; Stop may be called from any.
class Trainer {
 public:
  Trainer(const LearnerConfig& config, TrainerParts parts);

  // Continues from the state of a Checkpoint. DataLoss where a tensor or a counter is missing,
  // InvalidArgument where a tensor has another size than the config's networks; the message names it.
  absl::Status Load(const TensorFile& file);

  // Versions will be greater than `version`: labels of a learner that went on after its last checkpoint, and
  // was then killed, carry versions that this one would use again, and the replay refuses what is older than
  // a label it has.
  void StartVersionsAfter(std::uint64_t version) { snapshot_.version = std::max(snapshot_.version, version); }

  // Publishes the first policy, then updates until Stop, an error, or max_updates; saves at the end. After
  // max_updates it goes on serving until Stop. Blocks until then. OK after Stop. Errors: the final error of
  // the draws (Prefetcher), after which the state is saved too; those of Algorithm::Update, after which it is
  // worthless and nothing is saved; and those of the last save.
  absl::Status Run();
  void Stop();  // ends the draws and wakes Run

  std::uint64_t updates() const { return updates_; }

 private:
  // How the updates ended. Errors from outside leave the state as good as it was before them.
  struct End {
    absl::Status status;         // OK after Stop, and where all updates are made
    bool finished = false;       // all updates are made
    bool state_is_sound = true;  // false: an update failed
  };
  End UpdateToTheEnd();
  // Publishes the offline policy, waits for its evaluation and decides how the run goes on. False after Stop.
  bool PassBetweenPhases();
  // Makes one update and what is due after it. Errors are those of Algorithm::Update.
  absl::Status Update(std::unique_ptr<DrawnBatches> drawn);
  absl::Status Save();
  bool Stopping();
  void Publish();          // offers the newest policy under the next version
  void Record();           // writes a row of metrics
  void KeepPolicy();       // has the policy written under its number of updates
  void MaybeCheckpoint();  // offers a checkpoint where the last one is old enough
  Checkpoint MakeCheckpoint();
  void SetStatus(bool finished);

  const LearnerConfig config_;
  TrainerParts parts_;
  PolicySnapshot snapshot_;
  std::uint64_t updates_ = 0;
  std::uint64_t updates_at_record_ = 0;
  double updates_per_second_ = 0;
  absl::Time last_record_;
  absl::Time last_checkpoint_;
  absl::Time last_status_;
  absl::Mutex mutex_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace dbr
