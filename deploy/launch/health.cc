#include "deploy/launch/health.h"

#include <grpcpp/grpcpp.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/health.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {

HealthCheck::HealthCheck(const std::string& address, absl::Duration timeout,
                         std::function<void()> on_answer) {
  context_.set_wait_for_ready(true);
  SetDeadline(timeout, &context_);
  thread_ = std::thread([this, address, on_answer = std::move(on_answer)] {
    absl::Status answer = Ask(address);
    {
      absl::MutexLock lock(&mutex_);
      result_ = std::move(answer);
    }
    on_answer();
  });
}

HealthCheck::~HealthCheck() {
  context_.TryCancel();
  thread_.join();
}

std::optional<absl::Status> HealthCheck::result() const {
  absl::MutexLock lock(&mutex_);
  return result_;
}

absl::Status HealthCheck::Ask(const std::string& address) {
  const auto stub = grpc::health::v1::Health::NewStub(MakeChannel(address));
  const grpc::health::v1::HealthCheckRequest server_as_a_whole;
  grpc::health::v1::HealthCheckResponse response;
  const absl::Status status = FromGrpc(stub->Check(&context_, server_as_a_whole, &response));
  if (!status.ok()) {
    return absl::Status(status.code(), absl::StrCat("no answer from ", address, ": ", status.message()));
  }
  if (response.status() == grpc::health::v1::HealthCheckResponse::SERVING) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(address, " answers, but says that it is not serving"));
}

}  // namespace dbr
