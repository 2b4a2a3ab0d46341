#include "actor/policy_subscriber.h"

#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/monotonic_clock.h"
#include "core/status_macros.h"
#include "proto/config/config_file.h"
#include "proto/policy.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/protocol.h"

namespace dbr {
namespace {

// A stream that lives longer is opened again without a word, so that none can hang for ever.
constexpr absl::Duration kStreamLifetime = absl::Minutes(10);

}  // namespace

PolicySpec ExpectedPolicy(const EnvSpec& env, const Config& config) {
  return {.env = env.name,
          .algorithm = "",
          .observation_size = env.observation_size,
          .actions = env.actions,
          .hidden_sizes = HiddenSizes(config),
          .critic_layer_norm = config.network().critic_layer_norm()};
}

struct PolicySubscriber::Stub {
  explicit Stub(const std::string& address) : generated(Policy::NewStub(MakeChannel(address))) {}

  const std::unique_ptr<Policy::Stub> generated;
};

PolicySubscriber::PolicySubscriber(SubscriberOptions options)
    : options_(std::move(options)), stub_(std::make_unique<Stub>(options_.address)), rng_(options_.seed) {
  thread_ = std::thread(&PolicySubscriber::Run, this);
}

PolicySubscriber::~PolicySubscriber() {
  Close();
  thread_.join();
}

absl::StatusOr<PolicySubscriber::PolicyPtr> PolicySubscriber::Current() const {
  absl::MutexLock lock(&mutex_);
  if (!final_.ok()) return final_;
  return current_;
}

absl::StatusOr<PolicySubscriber::PolicyPtr> PolicySubscriber::WaitForOther(const PolicyPtr& last,
                                                                           absl::Duration timeout) const {
  absl::MutexLock lock(&mutex_);
  const auto ready = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return closed_ || !final_.ok() || (current_ != nullptr && current_ != last);
  };
  AwaitFor(&mutex_, absl::Condition(&ready), timeout);
  if (!final_.ok()) return final_;
  if (closed_) return absl::CancelledError("the subscription to the learner's policy is closed");
  if (!ready()) {
    return absl::DeadlineExceededError(
        absl::StrCat("expected a new policy from the learner at ", options_.address, " within ",
                     absl::FormatDuration(timeout), ", found none. Is the learner running?"));
  }
  return current_;
}

void PolicySubscriber::Close() {
  absl::MutexLock lock(&mutex_);
  closed_ = true;
  if (context_ != nullptr) context_->TryCancel();
}

void PolicySubscriber::Run() {
  for (;;) {
    const absl::Status status = Subscribe();
    if (IsFinal(status)) {
      absl::MutexLock lock(&mutex_);
      final_ = status;
      return;
    }
    {
      absl::MutexLock lock(&mutex_);
      if (closed_) return;
    }
    if (!absl::IsDeadlineExceeded(status)) SayLoss(status);
    const double growth = std::pow(2.0, std::min(attempts_++, 20));
    const absl::Duration backoff = std::min(options_.first_backoff * growth, options_.max_backoff);
    absl::MutexLock lock(&mutex_);
    if (AwaitFor(&mutex_, absl::Condition(&closed_), backoff * (0.5 + 0.5 * rng_.Uniform()))) return;
  }
}

absl::Status PolicySubscriber::Subscribe() {
  grpc::ClientContext context;
  SetDeadline(kStreamLifetime, &context);
  SubscribeRequest request;
  request.set_subscriber(options_.name);
  request.set_protocol_version(kProtocolVersion);
  {
    absl::MutexLock lock(&mutex_);
    if (closed_) return absl::CancelledError("closed");
    context_ = &context;
    // After a loss the learner may be another one, whose newest version is lower than ours: ask for what it
    // has.
    request.set_have_version(current_ != nullptr && !said_ ? current_->snapshot().version : 0);
  }
  const auto reader = stub_->generated->Subscribe(&context, request);
  PolicyMessage message;
  absl::Status taken;
  while (taken.ok() && reader->Read(&message)) taken = Take(message);
  if (!taken.ok()) context.TryCancel();
  const absl::Status status = FromGrpc(reader->Finish());
  {
    absl::MutexLock lock(&mutex_);
    context_ = nullptr;
  }
  if (!taken.ok()) return taken;
  if (absl::IsUnimplemented(status)) {
    return absl::UnimplementedError(
        absl::StrCat("expected a learner at ", options_.address,
                     ", found a server that has no policies. Check the learner's address."));
  }
  return status.ok() ? absl::UnavailableError("the learner ended the subscription") : status;
}

absl::Status PolicySubscriber::Take(const PolicyMessage& message) {
  RETURN_IF_ERROR(CheckProtocolVersion(message.protocol_version(), "the learner",
                                       absl::StrCat("the subscriber ", options_.name)));
  ASSIGN_OR_RETURN(PolicySnapshot snapshot, Decode(message));
  RETURN_IF_ERROR(CheckSameSpec(options_.expected, snapshot.spec));
  ASSIGN_OR_RETURN(PolicyPtr policy, PolicyNetworks::Create(std::move(snapshot)));
  SayReturn();
  const std::uint64_t version = policy->snapshot().version;
  PolicyPtr previous;  // released outside the lock
  {
    absl::MutexLock lock(&mutex_);
    previous = std::exchange(current_, std::move(policy));
  }
  attempts_ = 0;
  if (previous != nullptr && version < previous->snapshot().version) {
    spdlog::warn(
        "the learner offers policy version {} after version {}: it has started anew, its policy is taken",
        version, previous->snapshot().version);
  }
  return absl::OkStatus();
}

void PolicySubscriber::SayLoss(const absl::Status& status) {
  if (std::exchange(said_, true)) return;
  spdlog::warn("no policies from the learner at {}: {}. Trying again until it is there{}", options_.address,
               std::string(status.message()),
               Current().value_or(nullptr) ? "; acting with the last one meanwhile" : "");
}

void PolicySubscriber::SayReturn() {
  if (std::exchange(said_, false)) spdlog::info("the learner at {} sends policies", options_.address);
}

}  // namespace dbr
