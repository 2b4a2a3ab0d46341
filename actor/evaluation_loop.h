// Evaluates the newest policy again and again while it is trained.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "actor/evaluator.h"
#include "core/monotonic_clock.h"
#include "nn/policy.h"
#include "nn/policy_choice.h"
#include "proto/policy.pb.h"

namespace dbr {

struct EvaluationLoopOptions {
  std::vector<std::string> opponents;  // one evaluation each; {""} where the environment has none
  int episodes = 200;                  // for each opponent
  std::uint64_t seed = 1;              // a random seed, to which the policy's version is added
  ActingMode mode = MODE;
  PolicyChoice which = AVERAGE;  // the policy that plays; the raw one where there is no average
  int threads = 1;
  absl::Duration every = absl::Seconds(10);
  std::uint64_t every_updates = 0;  // above 0: evaluates by updates, in place of `every`
  // By updates: an earlier evaluator ran in this run. It was responsible for the iterations before this
  // loop's first policy.
  bool resumed = false;
};

// The functions through which the loop reaches the rest. Tests pass their own.
struct EvaluationLoopPorts {
  std::function<absl::StatusOr<std::shared_ptr<const PolicyNetworks>>()> newest_policy;  // null: none yet
  std::function<absl::Status(const EvaluationReport&)> report;
  // Returns the newest policy once it differs from `last` (null: once there is one). Only evaluation by
  // updates calls it. Returns DeadlineExceeded after `timeout`. It must return soon after Close(), with any
  // error.
  std::function<absl::StatusOr<std::shared_ptr<const PolicyNetworks>>(
      const std::shared_ptr<const PolicyNetworks>& last, absl::Duration timeout)>
      next_policy = nullptr;
  // Receives each policy as it played (WithActing, nn/policy_choice.h), with its mean over the opponents (of
  // scores, else of returns) and which one it is, before the last of its reports. May be null.
  std::function<void(double mean, PolicyChoice played, const PolicySnapshot&)> on_mean = nullptr;
  std::function<absl::Time()> now = MonotonicNow;
  // Returns at the deadline, or at once after Close(). Null means waiting by the real clock.
  std::function<void(absl::Time)> wait_until = nullptr;
};

// By time: every `every`, or as soon as the round before has ended, the loop evaluates the newest policy
// against each opponent, unless it evaluated that version last.
//
// By updates: a policy of u updates belongs to iteration u / every_updates, and the untrained one to
// iteration 0. The loop evaluates a new policy once its iteration is later than that of the last one
// evaluated. The policy that ends an offline phase is evaluated in any case: the learner waits for it. Else
// training continues meanwhile. Iterations that have passed by the end of a round are skipped; the
// log and the next report name them.
//
// Reports that find no learner are kept, at most the newest kMaxUnsent. They are sent in order when a learner
// is there. The log says once that the learner is lost and once that it is back. A report that the learner
// refuses is logged and dropped. One thread calls Run; Close is thread-safe.
class EvaluationLoop {
 public:
  static constexpr int kMaxUnsent = 1000;
  // By updates: the time between attempts to send kept reports.
  static constexpr absl::Duration kSendEvery = absl::Seconds(10);

  EvaluationLoop(EvaluationLoopOptions options, EvaluationLoopPorts ports);

  // Blocks until Close(), and then returns OK, or until an error of newest_policy, next_policy or Evaluate.
  absl::Status Run();

  void Close();  // from any thread; it also ends a running evaluation

 private:
  // What a report says about iterations. By time it is empty.
  struct Iterations {
    std::optional<std::uint64_t> current;
    std::vector<std::uint64_t> skipped;
  };

  absl::Status RunByTime();
  absl::Status RunByUpdates();
  absl::Status EvaluateIfNew();
  absl::Status EvaluateIfDue(const std::shared_ptr<const PolicyNetworks>& policy);
  Iterations Reach(std::uint64_t iteration);
  absl::Status EvaluateAll(const std::shared_ptr<const PolicyNetworks>& policy, const Iterations& iterations);
  void SendReports();

  const EvaluationLoopOptions options_;
  EvaluationLoopPorts ports_;
  std::shared_ptr<const PolicyNetworks> evaluated_;  // the last one evaluated; by time
  std::optional<std::uint64_t> last_iteration_;      // the last one evaluated; by updates
  std::optional<std::uint64_t> last_updates_;        // those of the policy evaluated last; by updates
  std::uint64_t skipped_ = 0;                        // the number of iterations skipped so far
  std::deque<EvaluationReport> unsent_;
  bool said_loss_ = false;
  std::atomic<bool> closing_ = false;
  absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

// What a mean over these evaluations is taken over, in words: "connect4 against random, mcts:10 by MODE".
std::string MeasureOf(const std::string& env, const EvaluationLoopOptions& options);

// Returns `configured`, or EvaluationOpponents(env) where `configured` is empty, or {""} where both are
// empty.
std::vector<std::string> OpponentsToEvaluate(const std::string& env,
                                             const std::vector<std::string>& configured);

}  // namespace dbr
