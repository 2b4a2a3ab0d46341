// Whether a server answers, by the standard gRPC health protocol.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace dbr {

// One question "are you serving?", asked in the background until the server answers or the timeout is over.
class HealthCheck {
 public:
  // `on_answer` is called once, from a thread of gRPC's, when result() has a value; it must not block.
  HealthCheck(const std::string& address, absl::Duration timeout, std::function<void()> on_answer);
  ~HealthCheck();  // cancels the question and waits for its end

  // Empty while there is no answer; OK, or DeadlineExceeded or Unavailable with the address.
  std::optional<absl::Status> result() const;

 private:
  struct Call;
  std::shared_ptr<Call> call_;
};

}  // namespace dbr
