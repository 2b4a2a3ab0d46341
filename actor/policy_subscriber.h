// The newest policy of the learner, kept up to date in the background.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "core/rng.h"
#include "nn/policy.h"
#include "proto/policy.pb.h"

namespace grpc {
class ClientContext;
}

namespace dbr {

struct SubscriberOptions {
  std::string address;     // the learner's: "unix:/path" or "host:port"
  std::string name;        // for people: "actor-0"
  PolicySpec expected;     // algorithm empty: any
  std::uint64_t seed = 1;  // for the jitter between attempts
  absl::Duration first_backoff = absl::Milliseconds(100);
  absl::Duration max_backoff = absl::Seconds(2);
};

// What a config asks of a policy for an environment: its networks' sizes; any algorithm.
PolicySpec ExpectedPolicy(const EnvSpec& env, const Config& config);

// Subscribes in a thread of its own until closed. A learner that goes away or sends a damaged policy is
// logged once and tried again, at growing intervals with jitter; its return is logged once; meanwhile the
// last policy stays current. A policy for another environment or other network sizes, a learner that speaks
// another protocol version, and a server that is no learner are final errors (IsFinal,
// proto/rpc/grpc_status.h). Whatever version the learner offers is taken, also a lower one (a learner that
// started anew). Thread-safe.
class PolicySubscriber {
 public:
  using PolicyPtr = std::shared_ptr<const PolicyNetworks>;

  explicit PolicySubscriber(SubscriberOptions options);
  ~PolicySubscriber();  // Close() and join

  // The newest policy, null before the first; or the final error. Does not block.
  absl::StatusOr<PolicyPtr> Current() const;

  // Waits for the first policy, or for another one than `last`. DeadlineExceeded, Cancelled after Close, or
  // the final error.
  absl::StatusOr<PolicyPtr> WaitForFirst(absl::Duration timeout) const {
    return WaitForOther(nullptr, timeout);
  }
  absl::StatusOr<PolicyPtr> WaitForOther(const PolicyPtr& last, absl::Duration timeout) const;

  void Close();  // from any thread; wakes those who wait

 private:
  struct Stub;  // the generated one is costly to compile, so that no header holds it

  void Run();
  absl::Status Subscribe();                         // one stream, until it breaks
  absl::Status Take(const PolicyMessage& message);  // a policy from the stream
  void SayLoss(const absl::Status& status);
  void SayReturn();

  const SubscriberOptions options_;
  const std::unique_ptr<Stub> stub_;
  // The subscriber's thread alone uses these three.
  Rng rng_;
  bool said_ = false;  // the log has the loss of the learner
  int attempts_ = 0;   // to open a stream, since the last policy

  mutable absl::Mutex mutex_;
  PolicyPtr current_ ABSL_GUARDED_BY(mutex_);
  absl::Status final_ ABSL_GUARDED_BY(mutex_);
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  grpc::ClientContext* context_ ABSL_GUARDED_BY(mutex_) = nullptr;  // that of the stream under way, not owned
  std::thread thread_;
};

}  // namespace dbr
