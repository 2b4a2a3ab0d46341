// What the learner serves to the other processes: the newest policy, the state of training, and a place for
// the evaluators' reports.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/policy_snapshot.h"
#include "proto/policy.grpc.pb.h"

namespace dbr {

// Holds one snapshot, the newest: a subscriber that is slow skips versions. A subscriber that speaks another
// protocol version is refused with FAILED_PRECONDITION (proto/rpc/protocol.h). Thread-safe.
class PolicyService final : public Policy::Service {
 public:
  // The newest reports that it holds for those who ask (proto/policy.proto says what becomes of older ones).
  static constexpr std::size_t kMaxReports = 4096;

  // `on_evaluation` is called from a server thread for each report; it must not block for long.
  // A subscription that waits for a policy looks every `look_for_reader` whether its reader is still there;
  // what is published, and Close, wake it at once.
  explicit PolicyService(std::function<void(const EvaluationReport&)> on_evaluation,
                         absl::Duration look_for_reader = absl::Seconds(1));

  // Offers a snapshot to all subscribers; its version grows from call to call.
  void Publish(const PolicySnapshot& snapshot);
  // Sets what Status answers, but for the subscribers, the evaluators' reports and the protocol version,
  // which the service knows itself.
  void SetStatus(LearnerStatus status);
  // The random number that tells this service from others, of earlier or later learners.
  std::uint64_t life() const { return life_; }
  // Ends all subscriptions with UNAVAILABLE; belongs before the server's Shutdown.
  void Close();

  grpc::Status Subscribe(grpc::ServerContext* context, const SubscribeRequest* request,
                         grpc::ServerWriter<PolicyMessage>* writer) override;
  grpc::Status Status(grpc::ServerContext* context, const LearnerStatusRequest* request,
                      LearnerStatus* reply) override;
  grpc::Status ReportEvaluation(grpc::ServerContext* context, const EvaluationReport* report,
                                EvaluationReportReply* reply) override;

 private:
  // Waits for a version other than `have`; null once closed, and after `timeout`.
  std::shared_ptr<const PolicyMessage> WaitForOther(std::uint64_t have, absl::Duration timeout);

  // Adds the reports that come after those that `have` says.
  void AddReports(const LearnerStatusRequest& have, LearnerStatus* reply) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::function<void(const EvaluationReport&)> on_evaluation_;
  const absl::Duration look_for_reader_;
  const std::uint64_t life_;  // random, not 0
  absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::shared_ptr<const PolicyMessage> newest_ ABSL_GUARDED_BY(mutex_);
  LearnerStatus status_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, EvaluationReport> evaluations_ ABSL_GUARDED_BY(mutex_);  // by opponent
  std::deque<EvaluationReport> reports_ ABSL_GUARDED_BY(mutex_);  // the newest, at most kMaxReports
  std::uint64_t newest_report_ ABSL_GUARDED_BY(mutex_) = 0;       // the number of the last one
  std::map<std::uint64_t, std::uint64_t> sent_versions_ ABSL_GUARDED_BY(mutex_);  // by subscription
  std::uint64_t next_subscription_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace dbr
