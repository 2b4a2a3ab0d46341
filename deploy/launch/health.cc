#include "deploy/launch/health.h"

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {
namespace {

// grpc.health.v1.HealthCheckResponse with `status` (field 1) SERVING (1). The request is the empty message:
// the server as a whole. Written out because the generated classes of that protocol are not packaged.
constexpr char kServing[] = "\x08\x01";

absl::Status ReadAnswer(const std::string& address, const grpc::Status& status,
                        const grpc::ByteBuffer& response) {
  if (!status.ok()) {
    const absl::Status error = FromGrpc(status);
    return absl::Status(error.code(), absl::StrCat("no answer from ", address, ": ", error.message()));
  }
  grpc::Slice slice;
  if (!response.DumpToSingleSlice(&slice).ok())
    return absl::InternalError("cannot read the answer of the health check");
  const std::string bytes(reinterpret_cast<const char*>(slice.begin()), slice.size());
  if (bytes == kServing) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(address, " answers, but says that it is not serving"));
}

}  // namespace

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

// Blocks until the answer, the deadline or the cancellation.
absl::Status HealthCheck::Ask(const std::string& address) {
  grpc::GenericStub stub(MakeChannel(address));
  grpc::CompletionQueue queue;
  grpc::ByteBuffer request(nullptr, 0), response;
  grpc::Status status;
  const auto call = stub.PrepareUnaryCall(&context_, "/grpc.health.v1.Health/Check", request, &queue);
  call->StartCall();
  call->Finish(&response, &status, &status);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  queue.Shutdown();
  while (queue.Next(&tag, &ok)) continue;
  return ReadAnswer(address, status, response);
}

}  // namespace dbr
