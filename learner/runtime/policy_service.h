// What the learner serves to the other processes: the newest policy, the state of training, and a place for
// the evaluators' reports.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "core/policy_snapshot.h"
#include "proto/policy.grpc.pb.h"

namespace dbr {

// Holds one snapshot, the newest: a subscriber that is slow skips versions. A subscriber that speaks another
// protocol version is refused with FAILED_PRECONDITION (proto/rpc/protocol.h). Thread-safe.
class PolicyService final : public Policy::Service {
 public:
  // `on_evaluation` is called from a server thread for each report; it must not block for long.
  explicit PolicyService(std::function<void(const EvaluationReport&)> on_evaluation);

  // Offers a snapshot to all subscribers; its version grows from call to call.
  void Publish(const PolicySnapshot& snapshot);
  // Sets what Status answers, but for the subscribers, the evaluators' reports and the protocol version,
  // which the service knows itself.
  void SetStatus(LearnerStatus status);
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

  const std::function<void(const EvaluationReport&)> on_evaluation_;
  absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::shared_ptr<const PolicyMessage> newest_ ABSL_GUARDED_BY(mutex_);
  LearnerStatus status_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, EvaluationReport> evaluations_ ABSL_GUARDED_BY(mutex_);  // by opponent
  std::set<std::uint64_t> skipped_iterations_ ABSL_GUARDED_BY(mutex_);
  std::map<std::uint64_t, std::uint64_t> sent_versions_ ABSL_GUARDED_BY(mutex_);  // by subscription
  std::uint64_t next_subscription_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace dbr
