// A double of the learner's policy service for the tests of this folder. It serves the policies that a test
// offers.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/clock.h"
#include "core/check.h"
#include "gtest/gtest.h"
#include "proto/policy.grpc.pb.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/protocol.h"
#include "proto/rpc/server.h"

namespace dbr {

// A folder of its own for the sockets of one test.
class SocketFolder {
 public:
  SocketFolder() : path_(absl::StrCat(::testing::TempDir(), "dbr-XXXXXX")) {
    DBR_CHECK(mkdtemp(path_.data()) != nullptr);
  }
  ~SocketFolder() { std::filesystem::remove_all(path_); }
  std::string Address(absl::string_view name) const {
    return absl::StrCat("unix:", path_, "/", name, ".sock");
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// Serves from construction to destruction. Thread-safe.
class LearnerDouble : public Policy::Service {
 public:
  explicit LearnerDouble(const std::string& address, std::uint32_t protocol_version = kProtocolVersion)
      : protocol_version_(protocol_version), running_(StartServer({.address = address}, {this}).value()) {}
  ~LearnerDouble() override {
    {
      absl::MutexLock lock(&mutex_);
      closed_ = true;
    }
    running_.server->Shutdown(absl::ToChronoTime(absl::Now() + absl::Seconds(2)));
  }

  void Offer(PolicyMessage message) {
    message.set_protocol_version(protocol_version_);
    absl::MutexLock lock(&mutex_);
    newest_ = std::move(message);
    ++offers_;
  }
  // The next `n` subscriptions end at once with Unavailable.
  void RefuseNext(int n) {
    absl::MutexLock lock(&mutex_);
    refusals_ = n;
  }
  std::vector<EvaluationReport> reports() const {
    absl::MutexLock lock(&mutex_);
    return reports_;
  }
  // Waits until n evaluations have been reported. Returns false after `timeout`.
  bool AwaitReports(int n, absl::Duration timeout) const {
    absl::MutexLock lock(&mutex_);
    const auto reached = [&] { return static_cast<int>(reports_.size()) >= n; };
    return mutex_.AwaitWithTimeout(absl::Condition(&reached), timeout);
  }
  int subscriptions() const {
    absl::MutexLock lock(&mutex_);
    return subscriptions_;
  }
  // Waits until there have been n subscriptions. Returns false after `timeout`.
  bool AwaitSubscriptions(int n, absl::Duration timeout) const {
    absl::MutexLock lock(&mutex_);
    const auto reached = [&] { return subscriptions_ >= n; };
    return mutex_.AwaitWithTimeout(absl::Condition(&reached), timeout);
  }

  grpc::Status Subscribe(grpc::ServerContext* context, const SubscribeRequest*,
                         grpc::ServerWriter<PolicyMessage>* writer) override {
    int sent = 0;
    {
      absl::MutexLock lock(&mutex_);
      ++subscriptions_;
      if (refusals_ > 0) {
        --refusals_;
        return grpc::Status(grpc::StatusCode::UNAVAILABLE, "not yet");
      }
    }
    for (;;) {
      PolicyMessage message;
      {
        absl::MutexLock lock(&mutex_);
        const auto ready = [&] { return closed_ || offers_ > sent || context->IsCancelled(); };
        // A client's cancellation wakes no condition, so the loop looks for it regularly.
        if (!mutex_.AwaitWithTimeout(absl::Condition(&ready), absl::Milliseconds(20))) continue;
        if (closed_ || context->IsCancelled()) return grpc::Status::OK;
        sent = offers_;
        message = *newest_;
      }
      writer->Write(message);
    }
  }

  grpc::Status ReportEvaluation(grpc::ServerContext*, const EvaluationReport* report,
                                EvaluationReportReply*) override {
    absl::MutexLock lock(&mutex_);
    reports_.push_back(*report);
    return grpc::Status::OK;
  }

 private:
  const std::uint32_t protocol_version_;
  mutable absl::Mutex mutex_;
  bool closed_ = false;
  int offers_ = 0;
  int refusals_ = 0;
  int subscriptions_ = 0;
  std::optional<PolicyMessage> newest_;
  std::vector<EvaluationReport> reports_;
  RunningServer running_;
};

}  // namespace dbr
