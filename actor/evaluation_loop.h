// Evaluating the newest policy again and again while it is trained.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
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
  std::uint64_t every_updates = 0;  // above 0: by updates, in place of `every`
  // By updates: another evaluator was there before, so that what came before the first policy was its affair.
  bool resumed = false;
};

// What the loop is connected to; a test passes its own.
struct EvaluationLoopPorts {
  std::function<absl::StatusOr<std::shared_ptr<const PolicyNetworks>>()> newest_policy;  // null: none yet
  std::function<absl::Status(const EvaluationReport&)> report;
  // The newest policy once it is another than `last` (null: once there is one); by updates alone.
  // DeadlineExceeded after `timeout`; returns soon after Close(), with any error.
  std::function<absl::StatusOr<std::shared_ptr<const PolicyNetworks>>(
      const std::shared_ptr<const PolicyNetworks>& last, absl::Duration timeout)>
      next_policy = nullptr;
  // Given the policy whose mean over the opponents (of scores, else of returns) is the greatest so far,
  // before it is reported; null: nobody asks.
  std::function<void(const PolicySnapshot&)> keep_best = nullptr;
  std::function<absl::Time()> now = absl::Now;
  // Returns at the deadline, or at once after Close(); null: waits for the real time.
  std::function<void(absl::Time)> wait_until = nullptr;
};

// By time: every `every` seconds, or as soon as the round before has ended, evaluates the newest policy
// against each opponent unless its version is the one evaluated last. By updates: a policy of u updates
// belongs to iteration u / every_updates, the untrained one to iteration 0. A new policy is evaluated once
// its iteration is later than that of the last one evaluated. Training goes on meanwhile: iterations that
// have passed by the end of a round are skipped, said in the log, and named in the next report. Reports that
// find no learner are kept, up to kMaxUnsent of the newest, and go out in order when it is there; the loss is
// said once and the return once. A report that the learner refuses is dropped with a word.
class EvaluationLoop {
 public:
  static constexpr int kMaxUnsent = 1000;
  static constexpr absl::Duration kSendEvery = absl::Seconds(10);  // by updates: kept reports are tried again

  EvaluationLoop(EvaluationLoopOptions options, EvaluationLoopPorts ports);

  // Blocks until Close(), which gives OK, or until an error of newest_policy, next_policy or Evaluate.
  absl::Status Run();

  void Close();  // from any thread; also ends an evaluation under way

 private:
  // What a report says of iterations; by time there is nothing to say.
  struct Iterations {
    std::optional<std::uint64_t> current;
    std::vector<std::uint64_t> skipped;
  };

  absl::Status RunByTime();
  absl::Status RunByUpdates();
  absl::Status EvaluateIfNew();
  absl::Status EvaluateIfDue(const PolicyNetworks& policy);
  Iterations Reach(std::uint64_t iteration);
  absl::Status EvaluateAll(const PolicyNetworks& policy, const Iterations& iterations);
  void KeepIfBest(double mean, const PolicySnapshot& snapshot);
  void SendReports();

  const EvaluationLoopOptions options_;
  EvaluationLoopPorts ports_;
  std::shared_ptr<const PolicyNetworks> evaluated_;  // last; by time
  std::optional<std::uint64_t> last_iteration_;      // that was evaluated
  std::uint64_t skipped_ = 0;                        // iterations so far
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
