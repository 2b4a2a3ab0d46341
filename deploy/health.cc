#include "deploy/health.h"

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "absl/synchronization/notification.h"
#include "proto/channel.h"
#include "proto/grpc_status.h"

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

struct HealthCheck::Call {
  explicit Call(const std::string& address) : stub(MakeChannel(address)) {}

  grpc::GenericStub stub;
  grpc::ClientContext context;
  grpc::ByteBuffer request{nullptr, 0};
  grpc::ByteBuffer response;
  absl::Notification done;
  mutable absl::Mutex mutex;
  std::optional<absl::Status> result ABSL_GUARDED_BY(mutex);
};

HealthCheck::HealthCheck(const std::string& address, absl::Duration timeout, std::function<void()> on_answer)
    : call_(std::make_shared<Call>(address)) {
  const grpc::Slice empty(static_cast<std::size_t>(0));
  call_->request = grpc::ByteBuffer(&empty, 1);
  call_->context.set_wait_for_ready(true);
  SetDeadline(timeout, &call_->context);
  call_->stub.UnaryCall(
      &call_->context, "/grpc.health.v1.Health/Check", {}, &call_->request, &call_->response,
      [call = call_, address, on_answer = std::move(on_answer)](const grpc::Status& status) {
        {
          absl::MutexLock lock(&call->mutex);
          call->result = ReadAnswer(address, status, call->response);
        }
        on_answer();
        call->done.Notify();
      });
}

HealthCheck::~HealthCheck() {
  call_->context.TryCancel();
  call_->done.WaitForNotification();
}

std::optional<absl::Status> HealthCheck::result() const {
  absl::MutexLock lock(&call_->mutex);
  return call_->result;
}

}  // namespace dbr
