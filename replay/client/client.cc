#include "replay/client/client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <set>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "core/status_macros.h"
#include "proto/replay.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/protocol.h"

namespace dbr {
namespace {

// How much later the client's own deadline is than the server's, so that the server's message arrives.
constexpr absl::Duration kAnswerTime = absl::Seconds(5);

// How long a call waits for a connection that is not there. Without somebody waiting a channel sees only
// every five seconds what became of its tries to connect.
constexpr absl::Duration kConnectTime = absl::Milliseconds(200);

absl::Status DecodePart(const SampledPart& part, const TransitionLayout& layout, Batch* out) {
  RETURN_IF_ERROR(Decode(part.transitions(), layout, out));
  if (part.keys_size() != out->size()) {
    return absl::InvalidArgumentError(absl::StrCat("keys: expected ", out->size(),
                                                   ", one for each transition of the batch, found ",
                                                   part.keys_size(), " from the replay server"));
  }
  out->keys.assign(part.keys().begin(), part.keys().end());
  return absl::OkStatus();
}

}  // namespace

class ReplayClient::Impl {
 public:
  explicit Impl(const std::string& address)
      : channel_(MakeChannel(address)), stub_(Replay::NewStub(channel_)) {}

  // Runs `call(context)` with a deadline, unless and until closed.
  template <class Call>
  absl::Status Run(absl::Duration timeout, const Call& call) ABSL_LOCKS_EXCLUDED(mutex_) {
    grpc::ClientContext context;
    if (timeout != absl::InfiniteDuration()) SetDeadline(timeout, &context);
    {
      absl::MutexLock lock(&mutex_);
      if (closed_) return absl::CancelledError("the replay client is closed");
      contexts_.insert(&context);
    }
    channel_->WaitForConnected(DeadlineAfter(std::min(timeout, kConnectTime)));
    const grpc::Status status = call(&context);
    absl::MutexLock lock(&mutex_);
    contexts_.erase(&context);
    return FromGrpc(status);
  }

  // Replies are kept for the next call: their columns have the right size already.
  std::unique_ptr<SampleReply> TakeReply() ABSL_LOCKS_EXCLUDED(mutex_) {
    absl::MutexLock lock(&mutex_);
    if (spare_replies_.empty()) return std::make_unique<SampleReply>();
    auto reply = std::move(spare_replies_.back());
    spare_replies_.pop_back();
    return reply;
  }
  void GiveReply(std::unique_ptr<SampleReply> reply) ABSL_LOCKS_EXCLUDED(mutex_) {
    absl::MutexLock lock(&mutex_);
    spare_replies_.push_back(std::move(reply));
  }

  void Close() ABSL_LOCKS_EXCLUDED(mutex_) {
    absl::MutexLock lock(&mutex_);
    closed_ = true;
    for (grpc::ClientContext* context : contexts_) context->TryCancel();
  }

  Replay::Stub& stub() { return *stub_; }

 private:
  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<Replay::Stub> stub_;
  absl::Mutex mutex_;
  std::set<grpc::ClientContext*> contexts_ ABSL_GUARDED_BY(mutex_);  // of the calls under way
  std::vector<std::unique_ptr<SampleReply>> spare_replies_ ABSL_GUARDED_BY(mutex_);
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

ReplayClient::ReplayClient(const std::string& address) : impl_(std::make_shared<Impl>(address)) {}

absl::Status ReplayClient::Sample(const DrawCounts& counts, const TransitionLayout& layout,
                                  absl::Duration timeout, DrawnBatches* out, const DrawTerms& terms) {
  SampleRequest request;
  request.set_uniform(static_cast<std::uint32_t>(counts.uniform));
  request.set_plus(static_cast<std::uint32_t>(counts.plus));
  request.set_minus(static_cast<std::uint32_t>(counts.minus));
  request.set_allow_empty_partitions(true);
  if (terms.seed_buffer_share.has_value()) request.set_seed_buffer_share(*terms.seed_buffer_share);
  request.set_first_transitions(terms.first_transitions);
  if (timeout != absl::InfiniteDuration()) request.set_wait_s(absl::ToDoubleSeconds(timeout));
  std::unique_ptr<SampleReply> reply = impl_->TakeReply();
  RETURN_IF_ERROR(impl_->Run(timeout + kAnswerTime, [&](grpc::ClientContext* context) {
    return impl_->stub().Sample(context, request, reply.get());
  }));
  RETURN_IF_ERROR(DecodePart(reply->uniform(), layout, &out->uniform));
  RETURN_IF_ERROR(DecodePart(reply->plus(), layout, &out->plus));
  RETURN_IF_ERROR(DecodePart(reply->minus(), layout, &out->minus));
  out->total_size = reply->total_size();
  out->plus_size = reply->plus_size();
  out->minus_size = reply->minus_size();
  out->unjudged_size = reply->unjudged_size();
  out->inserted = reply->inserted();
  out->episodes = reply->episodes();
  impl_->GiveReply(std::move(reply));
  return absl::OkStatus();
}

absl::StatusOr<RelabelReply> ReplayClient::Relabel(std::uint64_t critic_version,
                                                   absl::Span<const std::uint64_t> keys,
                                                   absl::Span<const float> advantages,
                                                   absl::Duration timeout) {
  RelabelRequest request;
  request.set_critic_version(critic_version);
  request.mutable_keys()->Add(keys.begin(), keys.end());
  request.mutable_advantages()->Add(advantages.begin(), advantages.end());
  RelabelReply reply;
  RETURN_IF_ERROR(impl_->Run(timeout, [&](grpc::ClientContext* context) {
    return impl_->stub().Relabel(context, request, &reply);
  }));
  return reply;
}

absl::StatusOr<StatsReply> ReplayClient::Stats(absl::Duration timeout) {
  StatsReply reply;
  RETURN_IF_ERROR(impl_->Run(timeout, [&](grpc::ClientContext* context) {
    return impl_->stub().Stats(context, StatsRequest(), &reply);
  }));
  RETURN_IF_ERROR(CheckProtocolVersion(reply.protocol_version(), "the replay server", "this program"));
  return reply;
}

void ReplayClient::Close() {
  impl_->Close();
}

}  // namespace dbr
