// Evaluating the newest policy again and again while it is trained.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "actor/evaluator.h"
#include "nn/policy.h"
#include "proto/policy.pb.h"

namespace dbr {

struct EvaluationLoopOptions {
  std::vector<std::string> opponents;  // one evaluation each; {""} where the environment has none
  int episodes = 200;                  // of each opponent
  std::uint64_t seed = 1;              // added to the policy's version
  ActingMode mode = MODE;
  int threads = 1;
  absl::Duration every = absl::Seconds(10);
};

// What the loop is connected to; a test passes its own.
struct EvaluationLoopPorts {
  std::function<absl::StatusOr<std::shared_ptr<const PolicyNetworks>>()> newest_policy;  // null: none yet
  std::function<absl::Status(const EvaluationReport&)> report;
  // Given the policy whose mean over the opponents (of scores, else of returns) is the greatest so far,
  // before it is reported; null: nobody asks.
  std::function<void(const PolicySnapshot&)> keep_best = nullptr;
  std::function<absl::Time()> now = absl::Now;
  // Returns at the deadline, or at once after Close(); null: waits for the real time.
  std::function<void(absl::Time)> wait_until = nullptr;
};

// Every `every` seconds, or as soon as the round before has ended, evaluates the newest policy against each
// opponent unless its version is the one evaluated last. Reports that find no learner are kept, up to
// kMaxUnsent of the newest, and go out in order when it is there; the loss is said once and the return once.
// A report that the learner refuses is dropped with a word.
class EvaluationLoop {
 public:
  static constexpr int kMaxUnsent = 1000;

  EvaluationLoop(EvaluationLoopOptions options, EvaluationLoopPorts ports);

  // Blocks until Close(), which gives OK, or until an error of newest_policy or Evaluate.
  absl::Status Run();

  void Close();  // from any thread; also ends an evaluation under way

 private:
  absl::Status EvaluateIfNew();
  void KeepIfBest(double mean, const PolicySnapshot& snapshot);
  void SendReports();

  const EvaluationLoopOptions options_;
  EvaluationLoopPorts ports_;
  std::shared_ptr<const PolicyNetworks> evaluated_;  // last
  std::deque<EvaluationReport> unsent_;
  double best_ = -std::numeric_limits<double>::infinity();
  bool said_loss_ = false;
  std::atomic<bool> closing_ = false;
  absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

// "" alone for an environment without opponents; else `configured`, or where that is empty
// EvaluationOpponents(env).
std::vector<std::string> OpponentsToEvaluate(const std::string& env,
                                             const std::vector<std::string>& configured);

}  // namespace dbr
