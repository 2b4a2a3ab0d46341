#include "learner/runtime/policy_service.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/monotonic_clock.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/protocol.h"

namespace dbr {
namespace {
std::uint64_t DrawLife() {
  std::random_device device;
  return (std::uint64_t{device()} << 32 | device()) | 1;  // never 0
}
}  // namespace

PolicyService::PolicyService(std::function<void(const EvaluationReport&)> on_evaluation,
                             absl::Duration look_for_reader)
    : on_evaluation_(std::move(on_evaluation)), look_for_reader_(look_for_reader), life_(DrawLife()) {}

void PolicyService::Publish(const PolicySnapshot& snapshot) {
  auto message = std::make_shared<PolicyMessage>(Encode(snapshot));
  message->set_protocol_version(kProtocolVersion);
  absl::MutexLock lock(&mutex_);
  newest_ = std::move(message);
}

void PolicyService::SetStatus(LearnerStatus status) {
  absl::MutexLock lock(&mutex_);
  status_ = std::move(status);
}

void PolicyService::Close() {
  absl::MutexLock lock(&mutex_);
  closed_ = true;
}

std::shared_ptr<const PolicyMessage> PolicyService::WaitForOther(std::uint64_t have, absl::Duration timeout) {
  const auto ready = [this, have]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return closed_ || (newest_ != nullptr && newest_->version() != have);
  };
  absl::MutexLock lock(&mutex_);
  if (!AwaitFor(&mutex_, absl::Condition(&ready), timeout) || closed_) return nullptr;
  return newest_;
}

grpc::Status PolicyService::Subscribe(grpc::ServerContext* context, const SubscribeRequest* request,
                                      grpc::ServerWriter<PolicyMessage>* writer) {
  const absl::Status version = CheckProtocolVersion(
      request->protocol_version(), absl::StrCat("the subscriber ", request->subscriber()), "the learner");
  if (!version.ok()) return ToGrpc(version);
  std::uint64_t have = request->have_version(), subscription = 0;
  {
    absl::MutexLock lock(&mutex_);
    subscription = next_subscription_++;
    sent_versions_[subscription] = have;
  }
  const absl::Cleanup forget = [&] {
    absl::MutexLock lock(&mutex_);
    sent_versions_.erase(subscription);
  };
  for (;;) {
    const std::shared_ptr<const PolicyMessage> message = WaitForOther(have, look_for_reader_);
    if (context->IsCancelled()) return grpc::Status::CANCELLED;
    absl::ReleasableMutexLock lock(&mutex_);
    if (closed_) return grpc::Status(grpc::StatusCode::UNAVAILABLE, "the learner is stopping");
    lock.Release();
    if (message == nullptr) continue;
    if (!writer->Write(*message)) return grpc::Status::CANCELLED;
    have = message->version();
    absl::MutexLock relock(&mutex_);
    sent_versions_[subscription] = have;
  }
}

void PolicyService::AddReports(const LearnerStatusRequest& have, LearnerStatus* reply) const {
  reply->set_life(life_);
  reply->set_newest_report(newest_report_);
  const std::uint64_t has = have.life() == life_ ? std::min(have.newest_report(), newest_report_) : 0;
  const std::size_t missing = std::min<std::uint64_t>(newest_report_ - has, reports_.size());
  reply->mutable_reports()->Assign(reports_.end() - static_cast<std::ptrdiff_t>(missing), reports_.end());
}

grpc::Status PolicyService::Status(grpc::ServerContext*, const LearnerStatusRequest* request,
                                   LearnerStatus* reply) {
  absl::MutexLock lock(&mutex_);
  *reply = status_;
  reply->set_protocol_version(kProtocolVersion);
  for (const auto& [opponent, report] : evaluations_) *reply->add_evaluations() = report;
  AddReports(*request, reply);
  reply->set_subscribers(static_cast<std::uint32_t>(sent_versions_.size()));
  std::uint64_t oldest = reply->policy_version();
  for (const auto& [subscription, version] : sent_versions_) oldest = std::min(oldest, version);
  reply->set_oldest_subscriber_version(oldest);
  return grpc::Status::OK;
}

grpc::Status PolicyService::ReportEvaluation(grpc::ServerContext*, const EvaluationReport* report,
                                             EvaluationReportReply*) {
  if (report->episodes() == 0 || !std::isfinite(report->return_mean())) {
    return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT,
                        "an evaluation needs episodes above 0 and a finite return_mean");
  }
  {
    absl::MutexLock lock(&mutex_);
    evaluations_[report->opponent()] = *report;
    reports_.push_back(*report);
    if (reports_.size() > kMaxReports) reports_.pop_front();
    ++newest_report_;
  }
  on_evaluation_(*report);
  return grpc::Status::OK;
}

}  // namespace dbr
