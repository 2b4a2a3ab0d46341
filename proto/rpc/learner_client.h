// Typed calls to the learner for everything but the stream of policies (actor/policy_subscriber.h).
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "proto/policy.pb.h"

namespace dbr {

// A connection to one learner. Thread-safe; calls block until their timeout. Errors carry the server's
// message: Unavailable where there is no learner, DeadlineExceeded where it did not answer, Unimplemented
// where another program listens at the address. IsFinal (proto/rpc/grpc_status.h) tells which of them another
// call may mend.
class LearnerClient {
 public:
  // Connects in the background: an address where nobody listens is an error of the calls.
  explicit LearnerClient(const std::string& address);
  ~LearnerClient();
  LearnerClient(const LearnerClient&) = delete;
  LearnerClient& operator=(const LearnerClient&) = delete;

  // The state of training, with the evaluators' reports that come after those that the caller has
  // (proto/policy.proto; by default it has none). FailedPrecondition where the learner speaks another
  // protocol version (proto/rpc/protocol.h).
  absl::StatusOr<LearnerStatus> Status(absl::Duration timeout, const LearnerStatusRequest& have = {});
  // Hands over the result of an evaluation. InvalidArgument for a report without episodes or without a finite
  // mean return.
  absl::Status ReportEvaluation(const EvaluationReport& report, absl::Duration timeout);

 private:
  class Impl;  // the generated stubs are costly to compile, so that no header holds them
  const std::unique_ptr<Impl> impl_;
};

}  // namespace dbr
