// Whether a server answers, by the standard gRPC health protocol.
#pragma once

#include <grpcpp/grpcpp.h>

#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"

namespace dbr {

// Asks one server "are you serving?" in a thread of its own, until it answers or the timeout is over. All
// methods are thread-safe.
class HealthCheck {
 public:
  // `on_answer` is called once, from that thread, when result() has a value; it must not block.
  HealthCheck(const std::string& address, absl::Duration timeout, std::function<void()> on_answer);
  ~HealthCheck();  // cancels the question and joins
  HealthCheck(const HealthCheck&) = delete;
  HealthCheck& operator=(const HealthCheck&) = delete;

  // Empty while there is no answer; OK, or DeadlineExceeded or Unavailable with the address.
  std::optional<absl::Status> result() const;

 private:
  // Blocks until the answer, the deadline or the cancellation.
  absl::Status Ask(const std::string& address);

  grpc::ClientContext context_;
  mutable absl::Mutex mutex_;
  std::optional<absl::Status> result_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace dbr
