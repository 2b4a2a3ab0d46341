#include "proto/rpc/learner_client.h"

#include <grpcpp/grpcpp.h>

#include "core/status_macros.h"
#include "proto/policy.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/protocol.h"

namespace dbr {

class LearnerClient::Impl {
 public:
  explicit Impl(const std::string& address) : stub_(Policy::NewStub(MakeChannel(address))) {}

  Policy::Stub& stub() { return *stub_; }

 private:
  const std::unique_ptr<Policy::Stub> stub_;
};

LearnerClient::LearnerClient(const std::string& address) : impl_(std::make_unique<Impl>(address)) {}
LearnerClient::~LearnerClient() = default;

absl::StatusOr<LearnerStatus> LearnerClient::Status(absl::Duration timeout,
                                                    const LearnerStatusRequest& have) {
  grpc::ClientContext context;
  SetDeadline(timeout, &context);
  LearnerStatus reply;
  RETURN_IF_ERROR(FromGrpc(impl_->stub().Status(&context, have, &reply)));
  RETURN_IF_ERROR(CheckProtocolVersion(reply.protocol_version(), "the learner", "this program"));
  return reply;
}

absl::Status LearnerClient::ReportEvaluation(const EvaluationReport& report, absl::Duration timeout) {
  grpc::ClientContext context;
  SetDeadline(timeout, &context);
  EvaluationReportReply reply;
  return FromGrpc(impl_->stub().ReportEvaluation(&context, report, &reply));
}

}  // namespace dbr
